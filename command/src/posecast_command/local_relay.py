"""Runs a relay and a robot's agent in one terminal: starts both, waits, prints the link, stops both."""

from __future__ import annotations

import argparse
import errno
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

from posecast_relay.config.settings import CHECKOUT, find_page
from posecast_relay.runtime.port_holder import name_holder
from posecast_wire.command_line.terminal import paint, print_error

from posecast_command.link import (
    draw_qr,
    has_browser,
    is_for_others,
    name_host,
    name_local_host,
    open_browser,
)
from posecast_command.processes import Processes, name_program

PAGE_PORT, ROBOTS_PORT = 8080, 7447  # or the next free ones
PORTS_SEARCHED = 100  # for a free one
ROBOTS_HOST = "127.0.0.1"  # without credentials a robot is on this machine
PAGE_FOLDER = "POSECAST_STATIC"  # in a checkout the page is not inside the relay
START_S = 30.0  # for the relay
SHOWN_S = 30.0  # then a line says that the robot is still starting
SERVES = b": serving http"
PORT_TRIES = 5  # another program may take a port between our look and the relay's
ENDED, FAILED, NOT_STARTED = 0, 1, 2
STATUSES = {
    ENDED: "stopped by Ctrl-C or a signal, or the source ended",
    FAILED: "the relay or the robot's agent failed",
    NOT_STARTED: "wrong arguments, or the relay or agent can't start",
}


class PortError(Exception):
    """No port is free. The message is one line."""


@dataclass(frozen=True)
class Place:
    """Where the relay serves the page. `port`: None for the first free port."""

    host: str = "127.0.0.1"
    port: int | None = None


def add_place_flags(parser: argparse._ActionsContainer) -> None:
    """Add --host, --port and --no-browser."""
    parser.add_argument(
        "--host",
        default=Place.host,
        metavar="HOST",
        help="address to serve the page on (127.0.0.1: this machine only); use 0.0.0.0 to open it from a "
        "phone in the same network",
    )
    parser.add_argument(
        "--port",
        type=_port,
        metavar="PORT",
        help=f"port to serve the page on (the first free one from {PAGE_PORT})",
    )
    parser.add_argument("--no-browser", action="store_true", help="only print the link; don't open a browser")


def read_place(args: argparse.Namespace) -> Place:
    """What the flags say."""
    return Place(args.host, args.port)


def _port(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text[:6]) <= 65535:
        raise argparse.ArgumentTypeError("use a number from 1 to 65535")
    return int(text)


def show_robot(
    robot: str, agent: Sequence[str], place: Place, environment: Mapping[str, str], *, browser: bool
) -> int:
    """Start a relay and `posecast AGENT…`, both with `environment`. Print the robot's link once it is on air,
    and wait for the end. Return the exit status. Raises PortError."""
    try:
        with Processes() as processes:
            found = _start_relay(processes, place, environment)
            if found is None:
                return NOT_STARTED
            relay, port, uplink = found
            arguments = [*agent, "--robot", robot, "--relay", uplink]
            process = processes.start(name_program(*arguments), environment=environment)
            local = f"http://{name_local_host(place.host)}:{port}"
            has_page = bool(environment.get(PAGE_FOLDER) or find_page())
            path = f"/#/r/{robot}" if has_page else f"/api/v1/robots/{robot}/state"
            if wait_until_shown(f"{local}/api/v1/robots/{robot}/state", robot, processes):
                if not has_page:
                    _say(f"the page is not built: run `make setup` in {CHECKOUT}")
                with suppress(OSError, ValueError):  # stdout is closed; the robot is on air anyway
                    shown = f"http://{name_host(place.host)}:{port}{path}"
                    _announce(shown, uplink, is_for_others(place.host))
                if has_page and browser and has_browser(environment):
                    open_browser(f"{local}{path}")
            while processes.find_ended() is None:
                processes.pause()
            return explain_end(relay, process)
    except KeyboardInterrupt:
        return ENDED


def wait_until_shown(
    state_url: str, robot: str, processes: Processes, now_s: Callable[[], float] = time.monotonic
) -> bool:
    """Wait until the relay answers with the robot's state at `state_url`. False when a process has ended:
    then an answer may come from another program. After SHOWN_S a line says that it is still waiting.
    """
    say_at_s: float | None = now_s() + SHOWN_S
    while True:
        answered = _answers(state_url)
        if processes.find_ended() is not None:
            return False
        if answered:
            return True
        if say_at_s is not None and now_s() >= say_at_s:
            _say(f"{robot} is not on air yet; waiting for it")
            say_at_s = None
        processes.pause()


def explain_end(relay: subprocess.Popen[bytes], agent: subprocess.Popen[bytes]) -> int:
    """The exit status after one of the two has ended. Prints why, unless that process did."""
    for process, name in ((relay, "the relay"), (agent, "the robot's agent")):
        status = process.poll()
        if status is not None and status < 0:
            _say(f"{name} was killed by signal {-status}")
            return FAILED
    if relay.poll() is not None:
        _say("the relay has ended")
        return FAILED
    return agent.returncode


def _start_relay(
    processes: Processes, place: Place, environment: Mapping[str, str]
) -> tuple[subprocess.Popen[bytes], int, str] | None:
    """Start a relay. Returns it, its page port and its endpoint for robots; None when it can't start, which
    has been reported."""
    for _ in range(PORT_TRIES):
        port = _choose_port(place)
        uplink_port = find_free_port(ROBOTS_HOST, ROBOTS_PORT)
        uplink = f"tcp/{ROBOTS_HOST}:{uplink_port}"
        flags = ["--host", place.host, "--port", str(port), "--zenoh-listen", uplink]
        command = name_program("relay", "run", "--dev", *flags)
        # wait for its own output: another relay may answer on this port
        relay, serves = processes.start_until(command, SERVES, START_S, environment)
        if serves:
            return relay, port, uplink
        if relay.poll() is None:
            _say(f"the relay did not start within {START_S:g} s")
            return None
        if not (is_taken(place.host, port) or is_taken(ROBOTS_HOST, uplink_port)):
            return None
        processes.forget(relay)
    return None


def _choose_port(place: Place) -> int:
    if place.port is None:
        return find_free_port(place.host, PAGE_PORT)
    if is_taken(place.host, place.port):
        raise PortError(f"port {place.port} is in use by {name_holder(place.port) or 'another program'}")
    return place.port


def is_taken(host: str, port: int) -> bool:
    """Whether another program listens on this port of `host`, an address or a name."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as e:
            return e.errno == errno.EADDRINUSE  # the relay reports any other problem
    return False


def find_free_port(host: str, first: int) -> int:
    """The first free port from `first` on. Raises PortError when the first PORTS_SEARCHED are in use."""
    for port in range(first, first + PORTS_SEARCHED):
        if not is_taken(host, port):
            return port
    raise PortError(f"ports {first} to {first + PORTS_SEARCHED - 1} of {host} are all in use")


def _answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=1) as answer:
            return bool(answer.status == 200)
    except (urllib.error.URLError, OSError):
        return False


def _announce(url: str, uplink: str, for_others: bool) -> None:
    _erase_progress_line()
    out = sys.stdout
    print(f"\n  Posecast is on air:  {paint(url, 'bold', out)}\n", file=out)
    if for_others and (code := draw_qr(url, out.encoding)):
        print(code, file=out)
    print(f"  More robots on this machine: --relay {uplink}\n  Ctrl-C ends it.", file=out, flush=True)


def _say(text: str) -> None:
    _erase_progress_line()
    print_error("posecast", text)


def _erase_progress_line() -> None:
    """Erase the agent's progress line, the last line of the terminal."""
    if sys.stderr.isatty():
        print("\r\x1b[K", end="", file=sys.stderr, flush=True)
