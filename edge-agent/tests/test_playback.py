"""Recordings are played at the pace of their own clock, from where and as often as asked."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from itertools import islice, pairwise
from pathlib import Path

import pytest
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.files.playback import Playback, Player, parse_playback


class Times:
    """A recording of nothing but instants."""

    def __init__(self, *times_s: float) -> None:
        self.description = "times"
        self.passes: list[bool] = []
        self._times_s = times_s

    def read_samples(self, start_s: float, first_pass: bool) -> Iterator[Sample]:
        self.passes.append(first_pass)
        for t_s in self._times_s:
            if t_s - self._times_s[0] >= start_s:
                yield Sample(t_s, {"pos": {"A": t_s}})


def timeline(*times_s: float, count: int = 100, **how: float) -> list[tuple[float, float]]:
    """(when due, robot time) of the first `count` samples."""
    player = Player(Times(*times_s), Playback(Path("x"), **how))  # type: ignore[arg-type]
    return [(due_s, sample.t_s) for due_s, sample in islice(player.schedule_samples(), count)]


def test_a_clock_that_steps_back_is_named_once(caplog: pytest.LogCaptureFixture) -> None:
    """Nor does a loop, whose passes follow each other."""
    timeline(1.0, 1.5, 1.25, 1.5, 1.25, loop=True)
    said = "times: its clock steps back from 1.500 s to 1.250 s; the order in the file counts"
    assert caplog.messages == [said]
    timeline(1.0, 1.5, 1.5, loop=True)
    assert caplog.messages == [said]


@pytest.mark.parametrize(
    ("address", "playback"),
    [
        ("a.csv", Playback(Path("a.csv"))),
        ("/x/a b.csv?loop", Playback(Path("/x/a b.csv"), loop=True)),
        ("a.csv?start=12.5&loop", Playback(Path("a.csv"), 12.5, loop=True)),
        ("a.csv?start=0", Playback(Path("a.csv"))),
    ],
)
def test_addresses(address: str, playback: Playback) -> None:
    assert parse_playback("csv", address) == playback


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("", "csv: give a path, such as csv:walk.csv"),
        ("?loop", "csv: give a path, such as csv:walk.csv"),
        ("a?start=soon", "csv: start='soon' is not a number of seconds"),
        ("a?start=-1", "csv: start='-1' is not a number of seconds"),
        ("a?start=inf", "csv: start='inf' is not a number of seconds"),
        ("a?loop=2", "csv: unknown option 'loop=2'; after ? use start=SECONDS and loop"),
        ("a?speed=2", "csv: unknown option 'speed=2'; after ? use start=SECONDS and loop"),
    ],
)
def test_wrong_addresses(address: str, reason: str) -> None:
    with pytest.raises(SourceError) as e:
        parse_playback("csv", address)
    assert str(e.value) == reason


def test_samples_are_due_as_they_came() -> None:
    assert timeline(5, 5.1, 5.1, 6) == [
        (0, 5),
        (pytest.approx(0.1), 5.1),
        (pytest.approx(0.1), 5.1),
        (pytest.approx(1), 6),
    ]


def test_a_long_gap_and_a_step_back_are_gone_over_at_once() -> None:
    assert timeline(0, 1, 1_700_000_000, 1_700_000_001, 3, 4) == [
        (0, 0),
        (1, 1),
        (1, 1_700_000_000),
        (2, 1_700_000_001),
        (2, 3),
        (3, 4),
    ]


def test_from_a_start() -> None:
    assert timeline(5, 6, 7, 8, start_s=1.5) == [(0, 7), (1, 8)]
    with pytest.raises(SourceError, match=r"^x: no samples after 9 s$"):
        timeline(5, 6, start_s=9)
    with pytest.raises(SourceError, match=r"^x: no samples$"):
        timeline()


def test_in_a_loop_robot_time_goes_on_and_complaints_do_not() -> None:
    recording = Times(5, 6, 8)
    player = Player(recording, Playback(Path("x"), start_s=1, loop=True))
    found = [(due_s, s.t_s, s.values["pos"]) for due_s, s in islice(player.schedule_samples(), 5)]
    assert found == [
        (0, 6, {"A": 6}),
        (2, 8, {"A": 8}),
        (4, 10, {"A": 6}),
        (6, 12, {"A": 8}),
        (8, 14, {"A": 6}),
    ]
    assert recording.passes == [True, False, False]
    assert [t_s for _, t_s in timeline(5, count=3, loop=True)] == [5, pytest.approx(5.1), pytest.approx(5.2)]


def test_in_real_time_every_sample_comes_in_order_and_never_early() -> None:
    player = Player(Times(*(3 + k / 500 for k in range(200))), Playback(Path("x")))
    came: list[tuple[float, float]] = []
    begun_s = time.monotonic()
    player.run(lambda s: came.append((time.monotonic() - begun_s, s.t_s)), threading.Event())
    assert [t_s for _, t_s in came] == [3 + k / 500 for k in range(200)]
    assert all(at_s >= t_s - 3 - 0.001 for at_s, t_s in came)
    assert all(a <= b for (a, _), (b, _) in pairwise(came))


def test_it_stops_when_told() -> None:
    stop = threading.Event()
    player = Player(Times(0, 9, 18), Playback(Path("x"), loop=True))
    thread = threading.Thread(target=player.run, args=(lambda _: None, stop))
    thread.start()
    stop.set()
    thread.join(10)
    assert not thread.is_alive()
