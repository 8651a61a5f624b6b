"""What takes a while shows how far it is, on a terminal, and leaves nothing behind."""

from __future__ import annotations

import io
import time
from collections.abc import Callable

import pytest
from posecast_wire.command_line import progress_bar
from posecast_wire.command_line.progress_bar import COLUMNS, ERASE, ProgressBar, show_countdown


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Clock:
    """Tells the time, and counts how often it was asked."""

    def __init__(self) -> None:
        self.now_s, self.asked = 100.0, 0

    def __call__(self) -> float:
        self.asked += 1
        return self.now_s


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress_bar, "TICK_S", 0.001)


def until(probe: Callable[[], bool]) -> None:
    deadline_s = time.perf_counter() + 20
    while not probe():
        assert time.perf_counter() < deadline_s
        time.sleep(0.001)


def test_a_bar_is_drawn_from_the_second_second_on_and_erased() -> None:
    out, clock = Terminal(), Clock()
    with ProgressBar(out, clock) as bar:
        bar.show_progress(1, 2, "arm\x1b.stl")
        until(lambda: clock.asked > 3)  # it has looked, and it was too early
        assert out.getvalue() == ""
        clock.now_s += 1.0
        until(lambda: bool(out.getvalue()))
        drawn = f"{ERASE}[############............] 1/2 arm�.stl"
        asked = clock.asked
        until(lambda: clock.asked > asked + 3)
        assert out.getvalue() == drawn  # what is the same is not drawn again
        bar.show_text("2 found")
        until(lambda: out.getvalue() == f"{drawn}{ERASE}2 found")
    assert out.getvalue() == f"{drawn}{ERASE}2 found{ERASE}"


def test_a_line_fits_a_terminal_and_a_long_path_keeps_its_end() -> None:
    out, clock = Terminal(), Clock()
    with ProgressBar(out, clock) as bar:
        clock.now_s += 1.0
        bar.show_progress(1, 1000, f"{'folder/' * 20}arm.stl")
        until(lambda: out.getvalue().endswith("folder/arm.stl"))
        bar.show_text("x" * 200)
        until(lambda: out.getvalue().endswith("x"))
    drawn = out.getvalue().split(ERASE)[1:-1]
    assert [len(line) for line in drawn] == [COLUMNS, COLUMNS]
    assert "] 1/1,000 …" in drawn[0]


def test_a_countdown_counts_seconds() -> None:
    out, clock = Terminal(), Clock()
    with show_countdown(out, 5.0, "s of demo", clock):
        until(lambda: clock.asked > 1)
        clock.now_s += 2.9
        until(lambda: out.getvalue().endswith("2/5 s of demo"))
        clock.now_s += 77.0
        until(lambda: out.getvalue().endswith("5/5 s of demo"))
    assert out.getvalue().endswith(f"5/5 s of demo{ERASE}")


def test_a_pipe_gets_none_of_it() -> None:
    out, clock = io.StringIO(), Clock()
    with ProgressBar(out, clock) as bar:
        bar.show_progress(1, 2, "x")
        clock.now_s += 2.0
    assert (out.getvalue(), clock.asked) == ("", 0)


def test_a_terminal_that_is_gone_ends_nothing() -> None:
    out, clock = Terminal(), Clock()
    with ProgressBar(out, clock) as bar:
        bar.show_text("x")
        out.close()
        clock.now_s += 2.0
        until(lambda: not bar._ticking.is_alive())
