from __future__ import annotations

import io
import logging
import os
import sys
from contextlib import suppress

import pytest
from posecast_edge.cli.console import CLEAR, LINES_MAX, WAITING_MAX, Console


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def record(text: str) -> logging.LogRecord:
    return logging.LogRecord("posecast_edge.x", logging.INFO, "", 0, text, None, None)


def test_a_log_file_gets_a_line_every_five_seconds() -> None:
    out = io.StringIO()
    console = Console(out)
    for i in range(120):
        if console.is_due(i / 10):
            console.show_progress(f"at {i / 10:g}", i / 10)
    assert out.getvalue() == "at 0\nat 5\nat 10\n"


def test_a_terminal_keeps_the_line_in_place_below_messages() -> None:
    out = Terminal()
    console = Console(out)
    console.show_progress("one", 0.0)
    console.emit(record("bad line"))
    console.show_progress("two", 0.5)
    console.finish()
    assert out.getvalue() == f"{CLEAR}one{CLEAR}posecast-edge: bad line\none{CLEAR}two\n"


def test_input_in_a_message_cannot_move_the_cursor() -> None:
    out = io.StringIO()
    Console(out).emit(record("\x1b[2Jboo\nposecast-edge: on air"))
    assert out.getvalue() == "posecast-edge: \\x1b[2Jboo\\nposecast-edge: on air\n"


def test_a_closed_stderr_is_no_reason_to_stop() -> None:
    out = io.StringIO()
    console = Console(out)
    out.close()
    console.show_progress("x", 0.0)


def test_a_flood_of_lines_is_counted() -> None:
    out, clock = io.StringIO(), [0.0]
    console = Console(out, lambda: clock[0])
    for i in range(1000):
        clock[0] = i / 100
        console.emit(record(f"attack {i}"))
    console.emit(logging.LogRecord("posecast_edge", logging.ERROR, "", 0, "the end", None, None))
    lines = out.getvalue().splitlines()
    assert lines[:3] == [f"posecast-edge: attack {i}" for i in range(3)]
    assert "posecast-edge: 93 more lines dropped" in lines
    assert lines[-1] == "posecast-edge: the end", "what ends the agent is always told"
    assert len(lines) <= 10 * LINES_MAX + WAITING_MAX + 1


def test_lines_of_one_moment_wait_for_the_next_seconds() -> None:
    out, clock = io.StringIO(), [0.0]
    console = Console(out, lambda: clock[0])
    said = [f"posecast-edge: part {i} is bad" for i in range(3 * LINES_MAX + 2)]
    for i in range(len(said)):
        console.emit(record(f"part {i} is bad"))
    for second in range(3):
        assert out.getvalue().splitlines() == said[: LINES_MAX * (second + 1)]
        clock[0] += 1.0
        console.is_due(clock[0])
    assert out.getvalue().splitlines() == said


def test_lines_that_wait_are_written_at_the_end() -> None:
    out = io.StringIO()
    console = Console(out, lambda: 0.0)
    for i in range(LINES_MAX + 5):
        console.emit(record(f"part {i} is bad"))
    console.close()
    assert len(out.getvalue().splitlines()) == LINES_MAX + 5


def test_a_line_has_an_end() -> None:
    out = io.StringIO()
    Console(out).emit(record("x" * 1_000_000))
    assert len(out.getvalue()) < 1000


def test_what_a_library_says_is_a_line_without_its_traceback() -> None:
    out = io.StringIO()
    console = Console(out, lambda: 0.0)
    try:
        raise OSError("gone\naway")
    except OSError:
        failed = sys.exc_info()
    for i in range(100):
        console.emit(logging.LogRecord("lib", logging.ERROR, "", 0, "ping %d failed", (i,), failed))
    lines = out.getvalue().splitlines()
    assert lines[0] == "posecast-edge: lib: ping 0 failed: OSError: gone\\naway"
    assert len(lines) == LINES_MAX, "its errors end nothing"


def test_words_that_do_not_fit_their_arguments() -> None:
    out = io.StringIO()
    Console(out).emit(logging.LogRecord("lib", logging.ERROR, "", 0, "%d", ("x",), None))
    assert out.getvalue() == "posecast-edge: lib: %d\n"


def test_a_pipe_that_nobody_reads_holds_nobody_up() -> None:
    clock = [0.0]
    read, write = os.pipe()
    os.set_blocking(write, False)
    with open(read, "rb", buffering=0) as reader, open(write, "w") as out:
        console = Console(out, lambda: clock[0])
        console.emit(record("first"))
        with suppress(BlockingIOError):
            while True:
                os.write(write, b"x" * 4096)
        os.set_blocking(write, True)
        for i in range(3):
            console.emit(record(f"lost {i}"))
            console.show_progress("lost", clock[0])
        console.finish()
        os.set_blocking(read, False)
        while reader.read(1 << 16):
            pass
        clock[0] = 1.0
        console.emit(record("again"))
        assert reader.read(4096) == b"posecast-edge: 3 more lines dropped\nposecast-edge: again\n"


@pytest.mark.parametrize(
    ("level", "head"),
    [
        (logging.ERROR, "\x1b[31mposecast-edge:\x1b[0m "),
        (logging.WARNING, "\x1b[33mposecast-edge:\x1b[0m "),
        (logging.INFO, "posecast-edge: "),
    ],
)
def test_colours_where_they_are_wanted(level: int, head: str, monkeypatch: pytest.MonkeyPatch) -> None:
    out = io.StringIO()
    loud = logging.LogRecord("posecast_edge", level, "", 0, "boo", None, None)
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.delenv("NO_COLOR", raising=False)
    Console(out).emit(loud)
    assert out.getvalue() == f"{head}boo\n"
    monkeypatch.setenv("NO_COLOR", "1")
    Console(out).emit(loud)
    assert out.getvalue().endswith("\nposecast-edge: boo\n")
