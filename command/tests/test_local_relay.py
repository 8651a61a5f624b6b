"""The port of the page, and what is printed of a robot before it is there and of a process that has ended."""

from __future__ import annotations

import socket
import sys
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import pytest
from posecast_command import local_relay
from posecast_command.local_relay import (
    FAILED,
    SHOWN_S,
    PortError,
    explain_end,
    find_free_port,
    is_taken,
    wait_until_shown,
)
from posecast_command.processes import Processes

SLEEP = [sys.executable, "-c", "import time; time.sleep(60)"]
LATE = "posecast: arm is not on air yet; waiting for it\n"


class Relay(ThreadingHTTPServer):
    """Answers with 404 `misses` times, then with 200."""

    misses = 0
    asked = 0


class Answer(BaseHTTPRequestHandler):
    server: Relay

    def do_GET(self) -> None:
        self.server.asked += 1
        self.send_response(404 if self.server.asked <= self.server.misses else 200)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Nothing."""


@pytest.fixture
def relay() -> Iterator[Relay]:
    with Relay(("127.0.0.1", 0), Answer) as server:
        Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        yield server
        server.shutdown()


def wait(relay: Relay, command: list[str], times_s: list[float]) -> bool:
    """With a clock that shows these times, and then the last of them."""
    with Processes() as processes:
        process = processes.start(command)
        if command != SLEEP:
            process.wait()
        url = f"http://127.0.0.1:{relay.server_port}/state"
        return wait_until_shown(
            url, "arm", processes, lambda: times_s.pop(0) if len(times_s) > 1 else times_s[0]
        )


def test_a_robot_that_is_there_at_once_is_shown_without_a_word(
    relay: Relay, capsys: pytest.CaptureFixture[str]
) -> None:
    assert wait(relay, SLEEP, [0.0, SHOWN_S - 0.1])
    assert capsys.readouterr().err == ""


def test_a_robot_that_is_late_is_waited_for_and_that_is_said_once(
    relay: Relay, capsys: pytest.CaptureFixture[str]
) -> None:
    relay.misses = 4
    assert wait(relay, SLEEP, [0.0, SHOWN_S - 0.1, SHOWN_S])
    assert relay.asked == 5
    assert capsys.readouterr().err == LATE


def test_what_answers_when_ours_has_ended_is_not_ours(relay: Relay) -> None:
    assert not wait(relay, [sys.executable, "-c", ""], [0.0])


@pytest.mark.parametrize(
    ("relay_does", "agent_does", "status", "printed"),
    [
        ("pass", None, FAILED, "posecast: the relay has ended\n"),
        ("import os; os.kill(os.getpid(), 9)", None, FAILED, "posecast: the relay was killed by signal 9\n"),
        (None, "import os; os.abort()", FAILED, "posecast: the robot's agent was killed by signal 6\n"),
        (None, "import sys; sys.exit(2)", 2, ""),
        (None, "pass", 0, ""),
    ],
)
def test_an_end_that_nobody_else_explains_is_explained(
    relay_does: str | None,
    agent_does: str | None,
    status: int,
    printed: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with Processes() as processes:
        relay, agent = (
            processes.start(SLEEP if does is None else [sys.executable, "-c", does])
            for does in (relay_does, agent_does)
        )
        (agent if relay_does is None else relay).wait()
        assert explain_end(relay, agent) == status
    assert capsys.readouterr().err == printed


def test_a_taken_port_is_passed_over() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert is_taken("127.0.0.1", port)
        assert find_free_port("127.0.0.1", port) > port
    assert not is_taken("127.0.0.1", port)


def test_a_listener_on_all_addresses_has_the_port_too() -> None:
    with socket.create_server(("0.0.0.0", 0)) as taken:
        assert is_taken("127.0.0.1", taken.getsockname()[1])


def test_there_is_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_relay, "PORTS_SEARCHED", 1)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(PortError, match=f"^ports {port} to {port} of 127.0.0.1 are all in use$"):
            find_free_port("127.0.0.1", port)


def test_a_host_that_is_not_of_this_machine_is_left_to_the_relay() -> None:
    assert not is_taken("192.0.2.1", 8080)
