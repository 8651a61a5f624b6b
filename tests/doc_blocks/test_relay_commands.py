"""The commands of docs/how-to/operate that need a relay, typed beside one that listens with TLS."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import Process, until

from relay.tests.certificates import certificates
from tests.doc_blocks.block import ROOT
from tests.doc_blocks.terminal import START_S, Terminal, fetch, find_line, read_script, read_scripts

OPERATE = "docs/how-to/operate"

pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl here")


class Lab:
    """A relay's machine, which is also its robots': `relay.pem`, its key and `relay-ca.pem` in a folder."""

    def __init__(self, stack: Any, folder: Path) -> None:
        self.folder = folder
        (folder / "made").mkdir()
        certificates(folder / "made", "relay", "DNS:localhost")
        for made, named in (("relay.pem",) * 2, ("relay.key",) * 2, ("ca.pem", "relay-ca.pem")):
            shutil.copy(folder / "made" / made, folder / named)
        self.terminal = Terminal(stack, folder, variables={"POSECAST_PAST": f"file://{folder}/past"})
        self.http = ""

    def serve(self, line: str) -> Process:
        """The relay of a command; the pages' names lead to it from then on."""
        here = line.replace("0.0.0.0:7447", "127.0.0.1:0")
        relay = self.terminal.start(here, "--port", "0")
        self.http, port = find_line(relay, r"serving http://(\S+), robots on tls/127\.0\.0\.1:(\d+)").groups()
        self.terminal.instead = {
            "relay.example:7447": f"localhost:{port}",
            "http://127.0.0.1:8080": f"http://{self.http}",
        }
        return relay

    def serve_as_installed(self) -> Process:
        """As docs/how-to/install/install.md starts it, with the past on a disk."""
        (self.folder / "past").mkdir(exist_ok=True)
        tls = "--zenoh-listen tls/0.0.0.0:7447 --zenoh-tls-cert relay.pem --zenoh-tls-key relay.key"
        return self.serve(f"posecast-relay run --robots robots.toml {tls}")

    def find_status(self, robot: str = "hubo") -> str | None:
        """What everybody sees of it; None if nobody does."""
        found = fetch(f"http://{self.http}/api/v1/robots/{robot}/state")
        return found and str(found["status"])


@pytest.fixture
def lab(stack: Any, tmp_path: Path) -> Lab:
    return Lab(stack, tmp_path)


def test_a_credential_is_rotated_while_the_robot_runs(lab: Lab) -> None:
    export, add, run, doctor, begin, lay, finish, leaked, remove = read_scripts(f"{OPERATE}/add-robots.md")
    shutil.copy(lab.folder / "relay-ca.pem", lab.folder / "ca.pem")
    lab.terminal.run(f"{export}\n{add}")
    lab.serve_as_installed()
    robot = lab.terminal.start(run)
    until("it is online", lambda: lab.find_status() == "online")
    assert "accepts 'hubo'" in lab.terminal.run(doctor)
    lab.terminal.run(f"{export}\n{begin}\n{lay}")
    until(
        "it tries the next credential", lambda: re.search(r"does not \w+ the new credential yet", robot.log)
    )
    assert lab.find_status() == "online"
    lab.terminal.run(f"{export}\n{finish}")
    until("it uses the next credential", lambda: "the new credential is in use" in robot.log)
    assert lab.find_status() == "online"
    lab.terminal.run(f"{export}\n{leaked}")
    until("it uses the last one", lambda: robot.log.count("the new credential is in use") == 2)
    until("it is online again", lambda: lab.find_status() == "online")
    assert "hubo" in lab.terminal.run(f"{export}\n{remove}")
    until("nobody sees it", lambda: lab.find_status() is None)


def test_the_path_of_the_robots_file_is_set_for_all_commands(lab: Lab) -> None:
    export = read_script(f"{OPERATE}/decide-who-watches.md", "export")
    lab.terminal.run("posecast-relay robots add hubo --robots robots.toml")
    assert "hubo" in lab.terminal.run(f"{export}\nposecast-relay robots list")


def test_a_robot_with_a_certificate_is_on_air(lab: Lab) -> None:
    make, add, serve, run = read_scripts(f"{OPERATE}/use-certificates.md")
    lab.terminal.run(f"{make}\n{add}")
    lab.serve(serve)
    lab.terminal.start(run)
    until("it is online", lambda: lab.find_status() == "online")


def test_what_is_left_of_a_past_is_listed(lab: Lab) -> None:
    add = "posecast-relay robots add hubo --robots robots.toml --ca relay-ca.pem"
    lab.terminal.run(f"umask 077; {add} > hubo.credential")
    lab.terminal.run("posecast-relay robots set hubo --robots robots.toml --keep 1d --anyone past=1h")
    (lab.folder / "past").mkdir()
    archive = f"--past file://{lab.folder}/past"
    tls = "--zenoh-listen tls/0.0.0.0:7447 --zenoh-tls-cert relay.pem --zenoh-tls-key relay.key"
    lab.serve(f"posecast-relay run --robots robots.toml {tls} {archive}")
    run = "posecast-edge run --credential hubo.credential --relay tls/relay.example:7447 --source demo"
    lab.terminal.start(run)
    past = f"http://{lab.http}/api/v1/robots/hubo/past"
    until("there is a past", lambda: (fetch(past) or {}).get("newest"), START_S)
    until("it is on the disk", lambda: any((lab.folder / "past").rglob("*.segment")), START_S)
    days, minutes = read_script(f"{OPERATE}/delete-the-past.md", "past list").splitlines()
    day = fetch(past)["days"][-1]
    assert day in lab.terminal.run(days)
    minute = str(fetch(f"{past}/public/{day}")["minutes"][-1]["minute"])
    ten_minutes = f"{minute.removesuffix('Z')[:-1]}0Z"
    found = json.loads(lab.terminal.run(minutes.replace("2026-11-22T14:20Z", ten_minutes)))
    assert found["segments"]


def test_a_relay_says_how_it_is(lab: Lab) -> None:
    check = read_script(f"{OPERATE}/troubleshoot.md", "robots check")
    lab.terminal.run("posecast-relay robots add hubo --robots robots.toml")
    lab.terminal.run(check)
    lab.serve_as_installed()
    live, ready = read_script(f"{OPERATE}/monitor.md", "curl").splitlines()
    lab.terminal.run(live)
    assert json.loads(lab.terminal.run(ready)) == {"status": "ready"}
    (lab.folder / "robots.toml").write_text("[robots.hubo]\nsecrets = 1\n")
    with pytest.raises(AssertionError, match="secrets"):
        lab.terminal.run(check)


@pytest.mark.skipif(shutil.which("promtool") is None, reason="no prometheus here")
def test_changed_alarms_are_checked(stack: Any, tmp_path: Path) -> None:
    check, restart = read_script(f"{OPERATE}/monitor.md", "promtool").splitlines()
    assert restart.startswith("docker compose ")  # whose service is one of the file's: test_doc_blocks.py
    terminal = Terminal(stack, tmp_path, {"infra/": f"{ROOT}/infra/"})
    assert "SUCCESS" in terminal.run(check)
