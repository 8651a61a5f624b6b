"""The reader of shared memory and a writer on a fake clock: how old a frame it finds, by how many looks."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable
from pathlib import Path
from typing import cast

import pytest
from posecast_edge.sources.hubo import ach_shm
from posecast_edge.sources.hubo.ach_shm import LOOKS_HZ, AchChannel, ShmReader
from posecast_edge.sources.hubo.reconnecting import WAIT_S

KEEPS = 7  # frames, as a Hubo's channel does
WAKING_S = 80e-6  # what it takes to wake up and look
HZ = 30.0


class Clock:
    """Stands where the reader's module `time` was. Every `every`-th time it wakes `late_s` later."""

    def __init__(self, now_s: float, late_s: float, every: int) -> None:
        self.now_s = now_s
        self._late_s, self._every, self._slept = late_s, every, 0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self._slept += 1
        self.now_s += seconds + WAKING_S + (self._late_s if self._slept % self._every == 0 else 0.0)


class Written:
    """A channel into which a frame was written at each of these times."""

    def __init__(self, times_s: list[float], clock: Clock) -> None:
        self.seq = 0
        self.looks_s: list[float] = []
        self._times_s, self._clock = times_s, clock
        self._seen, self._kept = 0, list[bytes]()  # what it has shown

    def save_frames(self) -> None:
        before, now_s = self._seen, self._clock.now_s
        self.looks_s.append(now_s)
        while self._seen < len(self._times_s) and self._times_s[self._seen] <= now_s:
            self._seen += 1
        self._kept += [b"%d" % k for k in range(max(before, self._seen - KEEPS), self._seen)]

    def read_new_frames(self) -> list[bytes]:
        self.save_frames()
        self.seq, kept, self._kept = self._seen, self._kept, []
        return kept

    def count_slots(self, size: int) -> int:
        return KEEPS

    def is_replaced(self, path: Path) -> bool:
        return False


class Seen:
    """What 30 frames a second were made of, from a time on."""

    def __init__(
        self,
        times_s: list[float],
        from_s: float,
        monkeypatch: pytest.MonkeyPatch,
        late_s: float = 0.0,
        every: int = 1,
    ) -> None:
        clock = Clock(times_s[0], late_s, every)
        monkeypatch.setattr(ach_shm, "time", clock)
        channel = Written(times_s, clock)
        reader = ShmReader(Path("channel"))
        reader._channel = cast(AchChannel, channel)
        self.ages_s: list[float] = []
        got: list[int] = []
        wanted_s = 0.0
        while clock.now_s < times_s[-1]:
            frames = [int(frame) for frame in reader._next(threading.Event(), wanted_s)]
            if clock.now_s >= from_s:
                got += frames
            if frames and clock.now_s >= wanted_s:
                if from_s <= clock.now_s < times_s[-1]:
                    self.ages_s.append(clock.now_s - times_s[frames[-1]])
                wanted_s = max(wanted_s + 1 / HZ, clock.now_s)
        self.ages_s.sort()
        assert got == sorted(set(got))
        self.lost = got[-1] - got[0] + 1 - len(got)
        seconds = times_s[-1] - from_s
        self.hz = len(self.ages_s) / seconds
        self.looks_hz = sum(s >= from_s for s in channel.looks_s) / seconds

    def age_s(self, part: float) -> float:
        return self.ages_s[int(len(self.ages_s) * part)]


def writer(hz: float, seconds: float, jitter_s: float = 0.0, start_s: float = 100.0) -> list[float]:
    dice = random.Random(1)
    return [start_s + k / hz + dice.uniform(0, jitter_s) for k in range(round(hz * seconds))]


@pytest.mark.parametrize("jitter_s", [0.0, 0.0002, 0.001])
@pytest.mark.parametrize("hz", [200, 100, 50, 31, 30, 10, 1])
def test_a_regular_writer_is_seen_as_it_writes_by_few_looks(
    hz: float, jitter_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = Seen(writer(hz, max(20.0, 240 / hz), jitter_s), 101 + 160 / hz, monkeypatch)
    assert seen.hz == pytest.approx(min(hz, 30), rel=0.12)
    assert seen.age_s(0.5) < 0.0005 + jitter_s
    assert seen.age_s(0.99) < 0.0015 + jitter_s
    assert seen.lost == 0
    # at 200 Hz six or seven frames are between two that are sent, and of seven some are kept before they are
    # overwritten; one look in fifty is too early
    assert seen.looks_hz <= (53 if hz == 200 else 32)


@pytest.mark.parametrize("every", [1, 2, 3, 7, 50])
@pytest.mark.parametrize("late_s", [0.002, 0.005, 0.0085])
def test_a_machine_that_wakes_us_late_loses_nothing(
    late_s: float, every: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = Seen(writer(200, 20.0), 101.0, monkeypatch, late_s, every)
    assert seen.lost == 0
    assert seen.hz == pytest.approx(30, rel=0.12)


def test_a_thousand_a_second_are_sampled_and_not_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = Seen(writer(1000, 10.0), 101.0, monkeypatch)
    assert seen.hz == pytest.approx(30, rel=0.1)
    assert seen.ages_s[-1] < 0.002
    assert seen.looks_hz <= LOOKS_HZ * 1.2


def test_an_irregular_writer_is_looked_for_often_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    dice = random.Random(2)
    times_s = [100.0]
    while times_s[-1] < 120.0:
        times_s.append(times_s[-1] + dice.choice([0.003, 0.005, 0.02, 0.09]))
    seen = Seen(times_s, 101.0, monkeypatch)
    assert seen.age_s(0.5) < 0.005
    assert seen.age_s(0.99) < 0.045
    assert seen.looks_hz < 300


def test_a_writer_that_is_held_up_now_and_then_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    dice = random.Random(3)
    times_s = [100.0]
    while times_s[-1] < 120.0:
        times_s.append(times_s[-1] + (0.005 if dice.random() > 0.05 else 0.025))
    seen = Seen(times_s, 101.0, monkeypatch)
    assert seen.lost <= 4  # of 2,900: nobody can know when he goes on
    assert seen.hz > 25
    assert seen.age_s(0.5) < 0.003
    assert seen.age_s(0.99) < 0.024


def test_the_last_before_a_silence_is_not_kept_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """A writer that stops just after a look, or later; nobody looks often at one who is silent."""
    for more in range(8):
        times_s = [*writer(200, 5.0 + more / 200), 110.0]
        seen = Seen(times_s, times_s[-3], monkeypatch)
        assert seen.ages_s == [] or seen.ages_s[-1] < 0.005 * 6 + 0.021
        assert seen.lost == 0
        assert seen.looks_hz < 1.3 * (1 / 0.005 + 5 / WAIT_S)


@pytest.mark.parametrize(
    "then",
    [
        lambda end_s: writer(200, 6.0, start_s=end_s + 0.0128),  # the same beat, out of step
        lambda end_s: writer(200, 6.0, start_s=end_s + 3.0),  # after a pause
        lambda end_s: writer(100, 6.0, start_s=end_s + 0.01),  # slower
        lambda end_s: writer(500, 6.0, start_s=end_s + 0.002),  # quicker
        lambda end_s: writer(200.5, 6.0, start_s=end_s + 0.005),  # hardly quicker
    ],
)
def test_another_beat_is_learned_within_a_second(
    then: Callable[[float], list[float]], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = writer(200, 5.0)
    after = then(before[-1])
    seen = Seen(before + after, after[0] + 1.0, monkeypatch)
    assert seen.age_s(0.9) < 0.002
    assert seen.hz == pytest.approx(30, rel=0.1)
    assert seen.looks_hz <= LOOKS_HZ * 1.2
