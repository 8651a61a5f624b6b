"""Predicts when a writer that does not notify its readers writes next, from earlier observations. Does no
I/O."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

LEARNED_FRAMES = 32  # until this many, look for every frame,
LEARNING = 0.8  # of a period after the previous one
SPAN_S = 4.0  # the period is the mean over about this time, and over at least twice LEARNED_FRAMES
# Each look in a row that is not too early makes the next one this much earlier, so that about one in fifty is
# too early. With an unknown phase, start as if UNMET looks in a row had been in time;
EARLIER_S = 1e-6
UNMET = 100
LATER = 3 / 4  # a look that was too early makes the next one later by this share of the error,
LATER_MAX_S = 0.5e-3  # but by no more than this: a single delayed frame does not predict the next ones
JUMPS_MAX = 3  # frames in a row that came a period off: the writer's phase has changed
SPARE_S = 0.006  # a look may be this late before the writer overwrites unseen frames,
SPARE_LATE = 3  # plus this many times the recent worst lateness
LOOKS_HZ = 100  # at most this many looks a second; frames of a faster writer with a small channel are lost


class Aim(NamedTuple):
    """A plan: look at `look_s` for the `frames`-th frame from now on; before that, save frames at the times
    `keep_s` so that the writer does not overwrite them unseen. Times are monotonic seconds."""

    frames: int
    look_s: float
    keep_s: Sequence[float] = ()


class WriterClock:
    """Estimates the writer's period and phase. Times are monotonic seconds."""

    def __init__(self) -> None:
        self.period_s = 0.0  # 0: not known
        self._written_s: float | None = None  # about when the newest was written
        self._span_s = 0.0
        self._span_frames = 0.0
        self._in_time = UNMET  # looks in a row
        self._jumps = 0

    def plan_look(self, wanted_s: float, latest_s: float, holds: int, late_s: float) -> Aim:
        """Plan to see the first frame written at `wanted_s` or later, or else the last one before `latest_s`.
        `holds`: how many frames the channel keeps; `late_s`: how late a look may be, seconds."""
        if self._written_s is None:
            return Aim(1, 0.0)
        if not self._learned:
            return Aim(1, self._written_s + LEARNING * self.period_s)
        frames = math.ceil((wanted_s - self._written_s) / self.period_s)
        frames = max(1, min(frames, int((latest_s - self._written_s) / self.period_s)))
        most = max(1, holds + 1 - math.ceil((SPARE_S + SPARE_LATE * late_s) / self.period_s))
        looks = min(math.ceil(frames / most), int(frames * self.period_s * LOOKS_HZ))
        keep_s = [
            self._written_s + (math.ceil(frames * k / looks) + 0.5) * self.period_s for k in range(1, looks)
        ]
        return Aim(frames, self._written_s + frames * self.period_s, keep_s)

    def record_look(self, frames: int, now_s: float, blind_s: float) -> None:
        """Record that `frames` new frames were found, the newest written before `now_s`. `blind_s`: seconds
        since the last look at which it was not yet written; 0 if there was no such look."""
        if self._written_s is None:
            self._written_s = now_s
            return
        at_s = now_s - blind_s / 2
        if self._learned:
            expected_s = self._written_s + frames * self.period_s
            late_s = at_s - expected_s
            if abs(late_s) > self.period_s:  # the writer paused or hurried
                self._jumps += 1
                if self._jumps == JUMPS_MAX:
                    self._span_s = self._span_frames = 0.0
                self._in_time = UNMET
                self._written_s = at_s
                return
            self._in_time = 0 if blind_s else self._in_time + 1
            later_s = min(LATER * late_s, LATER_MAX_S)
            at_s = expected_s + (later_s if blind_s else min(late_s, -EARLIER_S * self._in_time))
        self._jumps = 0
        if self._span_s > SPAN_S and self._span_frames > 2 * LEARNED_FRAMES:
            self._span_s, self._span_frames = self._span_s / 2, self._span_frames / 2
        self._span_s += at_s - self._written_s
        self._span_frames += frames
        self.period_s = self._span_s / self._span_frames
        self._written_s = at_s

    @property
    def _learned(self) -> bool:
        return self._span_frames >= LEARNED_FRAMES and self.period_s > 0
