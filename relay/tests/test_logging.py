"""One line each, bounded, in which everything can be seen; and not many, whatever strangers do."""

from __future__ import annotations

import asyncio
import json
import logging
import socket
import subprocess
import sys
from typing import Any

import pytest
from posecast_relay import logging as logs
from posecast_relay.logging import LINE_MAX, JsonLines, describe_error, visible
from posecast_testing import until

from .stage import Relay

HIDING = (
    "\u202e",
    "\u2066",
    "\u200b",
    "\ufeff",
    "\u00ad",
    "\u3164",
    "\u2800",
    "\ufe0f",
    "\U000e0041",
    "\ud800",
)
CONTROLS = ("\x1b", "\n", "\x85", "\u2028")


@pytest.mark.parametrize("hiding", HIDING + CONTROLS, ids=ascii)
def test_what_cannot_be_seen_is_escaped(hiding: str) -> None:
    shown = visible(f"rob{hiding}ot")
    assert hiding not in shown
    assert shown.startswith("rob\\u")
    assert shown.endswith("ot")
    assert shown.isprintable()


def test_a_text_is_bounded_and_a_plain_one_stays_as_it_is() -> None:
    assert visible("Roboter für Übungen, 한국어, 🤖") == "Roboter für Übungen, 한국어, 🤖"
    assert len(visible("x" * 10_000)) == len(visible("\u202e" * 10_000)) == logs.NAME_MAX
    assert visible("x" * 10_000).endswith("…")


def failed(error: Exception) -> logging.LogRecord:
    """As it is logged where it was caught."""
    try:
        raise error
    except Exception as e:
        return logging.LogRecord(
            "x", logging.ERROR, "f", 1, "at %s", ("r\u202e",), (type(e), e, e.__traceback__)
        )


def test_a_line_says_what_failed_and_where_and_no_more() -> None:
    line = JsonLines().format(failed(ValueError("two\nlines \u202e")))
    event = json.loads(line)["event"]
    assert event.startswith("at r\\u{202e}: ValueError: two\\u{a}lines \\u{202e} (test_logging.py:")
    assert len(json.loads(JsonLines().format(failed(ValueError("x" * 10_000))))["event"]) < LINE_MAX
    assert "exception" not in json.loads(line)
    record = logging.LogRecord("x", logging.INFO, "f", 1, "came", None, None)
    record.robot = "a\u202e" * 1000
    doc = json.loads(JsonLines().format(record))
    assert len(doc["robot"]) <= logs.NAME_MAX
    assert doc["robot"].isprintable()


def test_the_place_is_the_last_one_of_ours() -> None:
    with pytest.raises(TypeError) as refused:
        visible(None)  # type: ignore[arg-type]
    assert "(logging.py:" in describe_error(refused.value)


FAILS = """
import threading
from posecast_relay.logging import start_logging

class Ending:
    def __del__(self):
        raise KeyError("at its end")

def fail():
    raise KeyError("in a thread")

start_logging("warning")
for _ in range(30):
    thread = threading.Thread(target=fail)
    thread.start()
    thread.join()
    Ending()
"""


def test_what_fails_in_threads_and_libraries_is_a_line_and_they_are_few() -> None:
    done = subprocess.run([sys.executable, "-c", FAILS], capture_output=True, text=True, check=True)
    lines = [json.loads(line)["event"].partition(" (")[0] for line in done.stderr.splitlines()]
    assert 2 <= len(lines) <= 20
    assert set(lines) == {
        "uncaught exception: KeyError: 'in a thread'",
        "uncaught exception: KeyError: 'at its end'",
    }


async def test_malformed_requests_fill_no_log(relays: Any) -> None:
    relay: Relay = relays("--log-level", "info")
    port = relay.http
    kinds = (
        b"BAD\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET / HTTP/1.1\r\nUpgrade: x\r\nConnection: upgrade\r\n\r\n",
    )
    begun = len(relay.errors().splitlines())

    def ask(what: bytes) -> None:
        with socket.create_connection(("127.0.0.1", port), 10) as sock:
            sock.sendall(what)
            sock.recv(1000)

    for number in range(600):
        await asyncio.to_thread(ask, kinds[number % len(kinds)])
    assert len(relay.errors().splitlines()) - begun <= 30


async def test_a_crowd_that_comes_and_goes_is_counted(relays: Any) -> None:
    relay: Relay = relays("--log-level", "info")

    def come() -> None:
        head = (
            "GET /api/v1/robots/r/live HTTP/1.1\r\nHost: x\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
        )
        head += "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        with socket.create_connection(("127.0.0.1", relay.http), 10) as sock:
            sock.sendall(head.encode())
            sock.recv(1000)

    for _ in range(100):
        await asyncio.to_thread(come)
    lines = [json.loads(line)["event"] for line in relay.errors().splitlines()]
    assert lines.count("viewer connected") <= 10
    await asyncio.to_thread(
        until, "the rest is counted", lambda: "viewer connected … and " in relay.errors(), 30
    )
