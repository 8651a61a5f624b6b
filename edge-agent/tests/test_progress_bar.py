"""What takes a while shows how far it is, on a terminal, and leaves nothing behind."""

from __future__ import annotations

import io
import time

import pytest
from posecast_edge.cli import progress_bar
from posecast_edge.cli.progress_bar import Bar, show_countdown


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_bar_is_drawn_and_erased() -> None:
    out = Terminal()
    with Bar(out) as bar:
        bar.show_progress(1, 2, "arm\x1b.stl")
        assert out.getvalue() == "\r\x1b[K[############............] 1/2 arm�.stl"
    assert out.getvalue().endswith("\r\x1b[K")


def test_a_countdown_counts_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr(progress_bar, "TICK_S", 0.001)
    out, deadline_s = Terminal(), time.perf_counter() + 20
    with show_countdown(out, 5.0, "s of demo", lambda: clock[0]):
        clock[0] = 2.9
        while "2/5 s of demo" not in out.getvalue():
            assert time.perf_counter() < deadline_s
        clock[0] = 77.0
        while "5/5 s of demo" not in out.getvalue():
            assert time.perf_counter() < deadline_s
    assert out.getvalue().endswith("\r\x1b[K")


def test_a_pipe_gets_none_of_it() -> None:
    out = io.StringIO()
    with show_countdown(out, 5.0, "s"), Bar(out) as bar:
        bar.show_progress(1, 2, "x")
    assert out.getvalue() == ""
