"""A relay on this machine with a robot, in one terminal: started, waited for, announced, ended."""

from __future__ import annotations

import argparse
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from posecast_relay.config.built_page import CHECKOUT, find_page
from posecast_relay.port_holder import name_holder
from posecast_wire.command_line.color import paint

from posecast_command.link import (
    draw_qr,
    has_browser,
    is_for_others,
    name_host,
    name_local_host,
    open_browser,
)
from posecast_command.ports import PAGE_PORT, ROBOTS_PORT, PortError, find_free_port, is_taken
from posecast_command.processes import POLL_S, Processes, obey_endings

ROBOTS_HOST = "127.0.0.1"  # without credentials a robot is on this machine
START_S = 30.0
SERVES = b": serving http"
PORT_TRIES = 5  # another program may take a port between our look and the relay's
ENDED, FAILED, NOT_STARTED = 0, 1, 2
STATUSES = {
    ENDED: "ended by Ctrl-C, by a signal, or with its terminal",
    FAILED: "the relay or the robot's agent ended",
    NOT_STARTED: "wrong arguments, or one of them can't start",
}


@dataclass(frozen=True)
class Place:
    """Where the relay listens for pages. `port`: None for the first that is free."""

    host: str = "127.0.0.1"
    port: int | None = None


def add_place_flags(parser: argparse._ActionsContainer) -> None:
    """Add --host, --port and --no-browser."""
    parser.add_argument(
        "--host",
        default=Place.host,
        metavar="HOST",
        help="address on which the page is served (127.0.0.1: this machine alone); with 0.0.0.0 a phone in "
        "the same network can open it",
    )
    parser.add_argument(
        "--port",
        type=_port,
        metavar="PORT",
        help=f"port of the page (the first one from {PAGE_PORT} on that is free)",
    )
    parser.add_argument("--no-browser", action="store_true", help="print the link, and open no browser")


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
    """Start a relay and `posecast AGENT…`, say where the robot is to be seen once it is, and wait for the
    end. Return the exit status. Raises PortError."""
    obey_endings()
    try:
        with Processes() as processes:
            found = _start_relay(processes, place, environment)
            if found is None:
                return NOT_STARTED
            port, uplink = found
            process = processes.start([*agent, "--robot", robot, "--relay", uplink])
            local = f"http://{name_local_host(place.host)}:{port}"
            if not _wait(f"{local}/api/v1/robots/{robot}/state", processes):
                print(f"posecast: {robot} did not come on air", file=sys.stderr, flush=True)
                return process.poll() or FAILED
            has_page = bool(environment.get("POSECAST_STATIC") or find_page())
            path = f"/#/r/{robot}" if has_page else f"/api/v1/robots/{robot}/state"
            if not has_page:
                print(f"posecast: there is no page: `make setup` in {CHECKOUT} builds it", file=sys.stderr)
            _announce(f"http://{name_host(place.host)}:{port}{path}", uplink, is_for_others(place.host))
            if has_page and browser and has_browser(environment):
                open_browser(f"{local}{path}")
            while (over := processes.find_ended()) is None:
                time.sleep(POLL_S)
            return over.returncode if over is process else FAILED
    except KeyboardInterrupt:
        return ENDED


def _start_relay(
    processes: Processes, place: Place, environment: Mapping[str, str]
) -> tuple[int, str] | None:
    """The ports a relay listens on, for pages and (an endpoint) for robots; None when it has said why it
    doesn't."""
    for _ in range(PORT_TRIES):
        port = _choose_port(place)
        uplink_port = find_free_port(ROBOTS_HOST, ROBOTS_PORT)
        uplink = f"tcp/{ROBOTS_HOST}:{uplink_port}"
        flags = ["--host", place.host, "--port", str(port), "--zenoh-listen", uplink]
        command = ["relay", "run", "--dev", *flags]
        # by its own word: what answers on the port may be somebody else's relay
        relay, serves = processes.start_until(command, SERVES, START_S, environment)
        if serves:
            return port, uplink
        lost = is_taken(place.host, port) or is_taken(ROBOTS_HOST, uplink_port)
        if not lost or relay.poll() is None:
            return None
        processes.forget(relay)
    return None


def _choose_port(place: Place) -> int:
    if place.port is None:
        return find_free_port(place.host, PAGE_PORT)
    if is_taken(place.host, place.port):
        raise PortError(f"port {place.port} is taken by {name_holder(place.port) or 'another program'}")
    return place.port


def _wait(url: str, processes: Processes) -> bool:
    """Whether `url` answers in time, and by a process of ours: what answers when one of them has ended is
    somebody else's."""
    deadline_s = time.monotonic() + START_S
    while time.monotonic() < deadline_s:
        answered = _answers(url)
        if processes.find_ended() is not None:
            return False
        if answered:
            return True
        time.sleep(POLL_S)
    return False


def _answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=1) as answer:
            return bool(answer.status == 200)
    except (urllib.error.URLError, OSError):
        return False


def _announce(url: str, uplink: str, for_others: bool) -> None:
    if sys.stderr.isatty():
        print("\r\x1b[K", end="", file=sys.stderr, flush=True)  # the agent's line of progress stands there
    code = f"{draw_qr(url)}\n" if for_others else ""
    print(f"\n  Posecast is on air:  {paint(url, 'bold', sys.stdout)}\n")
    print(f"{code}  More robots on this machine: --relay {uplink}")
    print("  Ctrl-C ends it.", flush=True)
