"""One line each, bounded, in which everything can be seen; and not many, whatever strangers do."""

from __future__ import annotations

import asyncio
import json
import logging
import re
import socket
import ssl
import subprocess
import sys
from typing import Any

import pytest
from posecast_relay import logging as logs
from posecast_relay.logging import (
    KINDS_MAX,
    LINE_MAX,
    LINES_PER_S,
    OF_A_KIND,
    WINDOW_S,
    JsonLines,
    LoopExceptionHandler,
    RepeatFilter,
    describe_error,
    visible,
)
from posecast_testing import until

from .stage import Relay, request_stream

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
        with socket.create_connection(("127.0.0.1", relay.http), 10) as sock:
            sock.sendall(request_stream())
            sock.recv(1000)

    for _ in range(100):
        await asyncio.to_thread(come)
    lines = [json.loads(line)["event"] for line in relay.errors().splitlines()]
    assert lines.count("viewer connected") <= 10
    await asyncio.to_thread(
        until, "the rest is counted", lambda: "viewer connected … and " in relay.errors(), 30
    )


# ---- what repeats is said a few times, then counted. The clock is passed in ----------


def record(line: int, text: str = "it broke", level: int = logging.WARNING) -> logging.LogRecord:
    """One that is written at this line of a file."""
    return logging.LogRecord("x", level, "file.py", line, text, None, None)


def counted(records: list[logging.LogRecord]) -> int:
    """How many lines these say were left out."""
    found = [re.search(r"… and ([\d,]+) more in", each.getMessage()) for each in records]
    return sum(int(each[1].replace(",", "")) for each in found if each is not None)


def test_a_flood_of_one_kind_is_said_a_few_times_and_counted() -> None:
    repeats, said, told = RepeatFilter(), 0, list[logging.LogRecord]()
    for number in range(5000):
        now_s = number / 100
        told += repeats.take_summaries(now_s)
        said += repeats.allow_record(record(1, f"name {number}"), now_s)
    told += repeats.take_summaries(50 + WINDOW_S)
    assert said == OF_A_KIND * 50 / WINDOW_S
    assert said + counted(told) == 5000
    assert told[0].getMessage() == "name 0 … and 990 more in 10 s"
    assert told[0].levelno == logging.WARNING
    assert not repeats.owes


def test_no_attack_writes_more_than_ten_lines_a_second_and_each_is_counted() -> None:
    repeats, written, sums = RepeatFilter(), list[float](), list[logging.LogRecord]()
    lines = 0
    for number in range(20_000):
        now_s = number / 500
        found = repeats.take_summaries(now_s)
        sums += found
        written += [now_s] * len(found)
        if repeats.allow_record(record(number % 200), now_s):  # 200 kinds
            written.append(now_s)
            lines += 1
    now_s = 40.0
    while repeats.owes:
        now_s += 1.0
        sums += repeats.take_summaries(now_s)
    assert lines + counted(sums) == 20_000
    for second in range(40):
        assert sum(1 for at in written if second <= at < second + 1) <= LINES_PER_S
    assert len(repeats._kinds) <= KINDS_MAX + 1


def test_a_kind_is_a_place_and_an_error_and_not_a_name() -> None:
    repeats = RepeatFilter()

    def failed(error: Exception) -> logging.LogRecord:
        try:
            raise error
        except Exception as e:
            made = record(1)
            made.exc_info = (type(e), e, e.__traceback__)
            return made

    for number in range(OF_A_KIND):
        assert repeats.allow_record(failed(ValueError(f"name {number}")), 0.1 * number)
    assert not repeats.allow_record(failed(ValueError("another")), 1.5)
    assert repeats.allow_record(failed(KeyError("another")), 1.5)


def test_who_asks_for_level_debug_gets_it_all() -> None:
    repeats = RepeatFilter()
    assert all(repeats.allow_record(record(1, level=logging.DEBUG), 0.0) for _ in range(1000))


def test_what_is_remembered_holds_no_error() -> None:
    repeats = RepeatFilter()
    made = record(1)
    made.exc_info = (ValueError, ValueError("x"), None)
    repeats.allow_record(made, 0.0)
    (window,) = repeats._kinds.values()
    assert made not in vars(window).values()
    assert isinstance(window.first, str)


# ---- failures that nobody waits for --------------------------------------------------


async def test_a_connection_given_up_is_one_line_and_a_mistake_of_ours_is_named(
    caplog: pytest.LogCaptureFixture,
) -> None:
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(LoopExceptionHandler())
    caplog.set_level(logging.WARNING)
    for error in (ssl.SSLError(1, "CERTIFICATE_VERIFY_FAILED"),) * 3 + (ConnectionResetError("gone"),):
        loop.create_future().set_exception(error)  # nobody holds it
    said = [(record.getMessage(), record.exc_info) for record in caplog.records]
    assert [text.partition(": ")[0] for text, _ in said] == ["a connection timed out"] * 2
    assert "CERTIFICATE_VERIFY_FAILED" in said[0][0]
    assert not any(exc_info for _, exc_info in said)
    loop.create_future().set_exception(KeyError("ours"))
    assert re.fullmatch(r"Future exception was never retrieved: KeyError: 'ours'", shown(caplog.records[-1]))


def shown(record: logging.LogRecord) -> str:
    """The line as it is written."""
    return str(json.loads(JsonLines().format(record))["event"])


class Transport:
    """As the loop names it when something fails."""

    def __init__(self, closed: bool) -> None:
        self.is_closing = lambda: closed


async def test_what_still_comes_over_a_closed_transport_is_one_line(caplog: pytest.LogCaptureFixture) -> None:
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(LoopExceptionHandler())
    late = RuntimeError("unable to perform operation on <TCPTransport closed=True>; the handler is closed")
    for closed in (True, True, False):
        said = {"message": "Fatal error on SSL protocol", "exception": late, "transport": Transport(closed)}
        loop.call_exception_handler(said)
    assert [bool(record.exc_info) for record in caplog.records] == [False, True]
