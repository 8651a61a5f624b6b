"""`posecast demo` and `posecast run` as processes: their output is true, and no process is left behind."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import Process, free_port, until

from tests.conftest import BIN

ROOT = Path(__file__).resolve().parent.parent
ON_AIR = r"Posecast is on air:  (http://[^/]+)/#/r/(\S+)"
MORE = r"More robots on this machine: --relay (tcp/\S+)"
Starter = Callable[..., Process]


@pytest.fixture
def posecast(stack: Any) -> Starter:
    """Starts `posecast` with arguments."""

    def start(*argv: str, stdin: int | None = None, env: tuple[str, ...] = ()) -> Process:
        part: Process = stack.start("posecast", "env", *env, f"{BIN}/posecast", *argv, stdin=stdin)
        return part

    return start


def ask(url: str) -> Any:
    with urllib.request.urlopen(url, timeout=5) as answer:
        return json.load(answer)


def children(process: int) -> set[int]:
    return {int(n) for n in Path(f"/proc/{process}/task/{process}/children").read_text().split()}


def gone(processes: set[int]) -> bool:
    return not any(Path(f"/proc/{number}").exists() for number in processes)


def refused(*argv: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """To its end."""
    environment = {**os.environ, **environment}
    command = [f"{BIN}/posecast", *argv]
    return subprocess.run(
        command,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        stdin=subprocess.DEVNULL,
    )


OF_OTHERS = ("POSECAST_ROBOTS=/nowhere", "POSECAST_URDF=/nowhere", "POSECAST_CREDENTIAL=/nowhere")


@pytest.mark.parametrize(
    ("how", "env"), [(signal.SIGINT, ()), (signal.SIGTERM, OF_OTHERS), (signal.SIGHUP, ())]
)
def test_it_says_on_air_when_it_is_and_ends_whole(
    posecast: Starter, how: signal.Signals, env: tuple[str, ...]
) -> None:
    """Whatever is set for other commands."""
    port = free_port()
    demo = posecast("demo", "--no-browser", "--port", str(port), env=env)
    url, robot = demo.line(ON_AIR).groups()
    assert (url, robot) == (f"http://127.0.0.1:{port}", "demo")
    # it is there at once: nobody waits after having read that line
    assert ask(f"{url}/api/v1/robots/demo/state")["fields"]["pos"]["values"]
    assert ask(f"{url}/api/v1/robots")["publish_at"] == demo.line(MORE)[1]
    with urllib.request.urlopen(url, timeout=5) as answer:  # from a checkout it is the page built there
        assert answer.read() == (ROOT / "spa/dist/index.html").read_bytes()
    started = children(demo.process.pid)
    assert len(started) == 2
    demo.process.send_signal(how)
    assert demo.process.wait(timeout=30) == 0
    assert gone(started)


def test_without_a_page_it_says_how_to_build_one_and_links_to_what_there_is(
    posecast: Starter, tmp_path: Path
) -> None:
    source = tmp_path / "checkout/relay/src"
    shutil.copytree(ROOT / "relay/src", source, ignore=shutil.ignore_patterns("page", "__pycache__"))
    demo = posecast("demo", "--no-browser", "--port", str(free_port()), env=(f"PYTHONPATH={source}",))
    url = demo.line(r"Posecast is on air:  (\S+)")[1]
    assert ask(url)["fields"]["pos"]["values"]
    assert demo.log.count(f"posecast: the page is not built: run `make setup` in {tmp_path}/checkout\n") == 1


@pytest.mark.parametrize("redirection", ["", ">&- <&-"])
def test_a_robot_is_on_air_whether_anybody_reads_that_or_not(redirection: str, tmp_path: Path) -> None:
    """As with `posecast demo | true`, or started by a program that closes what it does not need."""
    opened, browser, said = tmp_path / "opened", tmp_path / "browser", tmp_path / "said"
    browser.write_text(f'#!/bin/sh\necho "$1" > {opened}.part && mv {opened}.part {opened}\n')
    browser.chmod(0o700)
    environment = {k: v for k, v in os.environ.items() if k != "CI" and not k.startswith("SSH_")}
    environment |= {"DISPLAY": ":0", "BROWSER": f"{browser} %s"}
    port = free_port()
    read, write = os.pipe()
    os.close(read)  # what is written there is an error
    with said.open("wb") as file:
        command = ["bash", "-c", f"exec {BIN}/posecast demo --port {port} {redirection}"]
        demo = subprocess.Popen(command, stdout=write, stderr=file, env=environment)
    os.close(write)
    try:
        until("a browser opens the link", opened.exists, 60)
        started = children(demo.pid)
        assert opened.read_text() == f"http://127.0.0.1:{port}/#/r/demo\n"
        assert ask(f"http://127.0.0.1:{port}/api/v1/robots/demo/state")["fields"]["pos"]["values"]
    finally:
        demo.terminate()
    assert demo.wait(timeout=30) == 0
    assert gone(started)
    assert "Traceback" not in said.read_text()


def test_two_side_by_side_and_a_robot_that_joins_one(posecast: Starter) -> None:
    both = [posecast("demo", "--no-browser") for _ in range(2)]
    said = [(demo.line(ON_AIR)[1], demo.line(MORE)[1]) for demo in both]
    assert len({url for url, _ in said}) == len({uplink for _, uplink in said}) == 2
    for url, uplink in said:
        listed = ask(f"{url}/api/v1/robots")
        assert ([robot["robot"] for robot in listed["robots"]], listed["publish_at"]) == (["demo"], uplink)
    (url, uplink), _ = said
    run = posecast("run", "--robot", "two", "--source", "demo", "--relay", uplink)
    until("both robots", lambda: len(ask(f"{url}/api/v1/robots")["robots"]) == 2)
    assert children(run.process.pid) == set()
    assert "on air:" not in run.out


def test_a_named_port_that_is_taken_names_who_has_it() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        ended = refused("demo", "--port", port)
    name = Path("/proc/self/comm").read_text().strip()
    assert ended.stderr == f"posecast demo: port {port} is in use by {name} (process {os.getpid()})\n"
    assert (ended.returncode, ended.stdout) == (2, "")


@pytest.mark.parametrize(
    ("argv", "environment", "why"),
    [
        (
            ("demo",),
            {"POSECAST_STATIC": "/nowhere"},
            "posecast relay: POSECAST_STATIC '/nowhere': use a folder that contains index.html",
        ),
        (("run", "--source", "csv:/nowhere.csv"), {}, "posecast edge: /nowhere.csv: "),
    ],
)
def test_what_cannot_start_is_never_on_air(
    argv: tuple[str, ...], environment: dict[str, str], why: str
) -> None:
    ended = refused(*argv, "--no-browser", "--port", str(free_port()), **environment)
    assert ended.returncode == 2
    assert why in ended.stderr
    assert "on air:" not in ended.stdout + ended.stderr


def test_run_puts_a_robot_on_a_relay_of_its_own(posecast: Starter, tmp_path: Path) -> None:
    urdf = tmp_path / "My Arm.urdf"
    urdf.write_text('<robot name="arm"><link name="base"/></robot>')
    wave = subprocess.Popen([sys.executable, "-c", WAVE], stdout=subprocess.PIPE)
    assert wave.stdout is not None
    words = ("run", "--source", "jsonl", "--urdf", str(urdf), "--no-browser", "--port", str(free_port()))
    run = posecast(*words, stdin=wave.stdout.fileno())
    url, robot = run.line(ON_AIR).groups()
    assert robot == "my-arm"
    assert ask(f"{url}/api/v1/robots/my-arm/state")["fields"]["pos"]["values"] == {"elbow": 0.25}
    wave.terminate()
    wave.wait()
    wave.stdout.close()
    # the robot is over, and so is all that was started for it
    assert run.process.wait(timeout=30) == 0


WAVE = """
import itertools, json, time
for n in itertools.count():
    print(json.dumps({"t": n / 50, "pos": {"elbow": 0.25}}), flush=True)
    time.sleep(0.02)
"""
