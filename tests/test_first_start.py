"""infra/first_start.sh: relay and robot accept the files that a containerised cloud creates for itself."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import until

from tests.conftest import BIN

SCRIPT = Path(__file__).resolve().parent.parent / "infra" / "first_start.sh"

pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl here")


def start(folder: Path, site: str = "localhost") -> dict[str, bytes]:
    """Runs it; returns every file created."""
    for name in ("secret", "robots"):
        (folder / name).mkdir(exist_ok=True)
    environment = {
        "PATH": f"{BIN}:{os.environ['PATH']}",
        "SECRET_FOLDER": str(folder / "secret"),
        "ROBOTS_FOLDER": str(folder / "robots"),
        "SITE": site,
    }
    done = subprocess.run([SCRIPT], env=environment, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_relay_and_a_robot_meet_on_it(stack: Any, tmp_path: Path) -> None:
    start(tmp_path, "localhost, posecast.lab.example,10.0.0.5")
    secret = tmp_path / "secret"
    relay = stack.start(
        "relay",
        *(f"{BIN}/posecast-relay", "run", "--port", "0", "--zenoh-listen", "tls/127.0.0.1:0"),
        *("--zenoh-tls-cert", str(secret / "relay.pem"), "--zenoh-tls-key", str(secret / "relay.key")),
        *("--robots", str(tmp_path / "robots/robots.toml")),
    )
    port = relay.line(r"robots on tls/127\.0\.0\.1:(\d+)")[1]
    credential = ("--credential", str(secret / "demo.credential"))
    words = ("run", "--source", "demo", *credential, "--relay", f"tls/localhost:{port}")
    edge = stack.start("edge", f"{BIN}/posecast-edge", *words)
    until("the robot is on air", lambda: "on air" in edge.log)


def test_what_is_there_stays(tmp_path: Path) -> None:
    first = start(tmp_path)
    assert start(tmp_path) == first
    moved = start(tmp_path, "posecast.lab.example")
    assert {name for name in first if moved[name] != first[name]} == {
        "secret/names",
        "secret/relay.key",
        "secret/relay.pem",
    }
    assert set(moved) == set(first)


def test_the_certificate_names_what_site_names(tmp_path: Path) -> None:
    start(tmp_path, "https://lab.example:8443, 10.0.0.5:8443,[fd77::5], [fd77::6]:8443 fd77::7 *.lab.example")
    show = ("openssl", "x509", "-noout", "-ext", "subjectAltName", "-in", tmp_path / "secret/relay.pem")
    shown = subprocess.run(show, capture_output=True, text=True, check=True).stdout
    addresses = ("10.0.0.5", "FD77:0:0:0:0:0:0:5", "FD77:0:0:0:0:0:0:6", "FD77:0:0:0:0:0:0:7")
    assert shown.splitlines()[1].strip().split(", ") == [
        *("DNS:relay", "DNS:lab.example"),
        *(f"IP Address:{each}" for each in addresses),
        "DNS:*.lab.example",
    ]


def test_nobody_else_may_read_it(tmp_path: Path) -> None:
    start(tmp_path)
    for path in (tmp_path / "secret").iterdir():
        mode = stat.S_IMODE(path.stat().st_mode)
        # Redis shares the group and reads its own file
        assert (
            mode & (0o007 if path.name in ("redis.conf", "store", "ca.pem", "relay.pem", "names") else 0o077)
            == 0
        )
