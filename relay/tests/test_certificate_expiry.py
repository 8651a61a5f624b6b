"""When certificates expire: read as openssl reads it, and told by a running relay."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import httpx
import pytest
from posecast_relay.zenoh.router import read_expiry
from posecast_testing import free_port

from .certificates import KEY, certificates
from .stage import Relay


def make(folder: Path, days: int, extra: str = "") -> Path:
    words = f"req -x509 {KEY} -days {days} -subj /CN=x -keyout {days}.key -out {days}.pem {extra}"
    subprocess.run(["openssl", *words.split()], cwd=folder, check=True, capture_output=True)
    return folder / f"{days}.pem"


def ask_openssl(file: Path) -> float:
    words = ["openssl", "x509", "-in", str(file), "-noout", "-enddate"]
    said = subprocess.run(words, check=True, capture_output=True, text=True).stdout.strip()
    return datetime.strptime(said, "notAfter=%b %d %H:%M:%S %Y GMT").replace(tzinfo=UTC).timestamp()


# a year before 2050 is written with two digits, one after it with four
@pytest.mark.parametrize("days", [1, 3650, 36500])
def test_it_is_what_openssl_says(tmp_path: Path, days: int) -> None:
    certificates(tmp_path)  # skips without openssl
    file = make(tmp_path, days)
    assert read_expiry(file) == ask_openssl(file)


def test_of_a_chain_it_is_the_first_that_expires(tmp_path: Path) -> None:
    certificates(tmp_path)
    long, short = make(tmp_path, 400), make(tmp_path, 20)
    chain = tmp_path / "chain.pem"
    chain.write_text("bag attributes\n" + long.read_text() + short.read_text())
    assert read_expiry(chain) == ask_openssl(short)


@pytest.mark.parametrize("block", ["", "AAAA", "MA==", "MIIBszCCAVmgAwIBAgIU", "…"])
def test_what_is_no_certificate_is_named(tmp_path: Path, block: str) -> None:
    file = tmp_path / "x.pem"
    file.write_text(f"-----BEGIN CERTIFICATE-----\n{block}\n-----END CERTIFICATE-----\n")
    with pytest.raises(ValueError, match=r"can't be read|longer than|no certificate"):
        read_expiry(file)
    file.write_text("nothing of the kind")
    with pytest.raises(ValueError, match=r"x\.pem: contains no certificate"):
        read_expiry(file)


def test_a_running_relay_tells_it(tmp_path: Path, relays: Callable[..., Relay]) -> None:
    certificates(tmp_path)
    robots, port = tmp_path / "robots.toml", free_port()
    robots.touch(0o600)
    robots.write_text("[robots]\n")
    relays(
        *("--robots", str(robots), "--metrics-port", str(port)),
        *("--zenoh-tls-cert", str(tmp_path / "server.pem"), "--zenoh-tls-key", str(tmp_path / "server.key")),
        *("--zenoh-ca", str(tmp_path / "ca.pem")),
        dev=False,
    )
    text = httpx.get(f"http://127.0.0.1:{port}/metrics").text
    line = r"^posecast_certificate_expiry_timestamp_seconds\{flag=\"(.*)\"\} (\S+)$"
    told = {flag: float(value) for flag, value in re.findall(line, text, re.MULTILINE)}
    assert told == {
        "--zenoh-tls-cert": ask_openssl(tmp_path / "server.pem"),
        "--zenoh-ca": ask_openssl(tmp_path / "ca.pem"),
    }
