"""What every sample passes on its arrival: texts that no message can carry are removed, and samples that were
delayed on their way are recognised. Does no I/O; time is an argument."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from posecast_edge.kit import PartLog, quote
from posecast_edge.sample import Sample


def is_text(value: object) -> bool:
    """Whether `value` is a string of Unicode scalar values only (no lone surrogates)."""
    if not isinstance(value, str):
        return False
    if value.isascii():
        return True
    try:
        value.encode()
    except UnicodeEncodeError:
        return False
    return True


class TextGuard:
    """Removes texts that no message can carry, and logs them: a lone half of a surrogate pair is valid in a
    Python string and in JSON, but cannot be encoded as UTF-8. Not thread-safe."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._bad = PartLog(say, "invalid names and texts")
        self._good: Mapping[str, str] | None = None  # already checked: most samples repeat the same texts

    def clean(self, sample: Sample) -> Sample:
        """The sample without entries of `info` and `links` that are not valid text."""
        info, links = sample.info, sample.links
        if info and info != self._good:
            good = self._texts("info", info, sample)
            self._good = dict(good)
            if len(good) < len(info):
                sample = sample._replace(info=good)
        if links:
            good = self._texts("the link of", links, sample)
            if len(good) < len(links):
                sample = sample._replace(links=good)
        return sample

    def _texts(self, what: str, given: Mapping[str, str], sample: Sample) -> Mapping[str, str]:
        return {
            name: text
            for name, text in given.items()
            if (is_text(name) and is_text(text)) or self._report(f"{what} {quote(name)}", sample)
        }

    def _report(self, what: str, sample: Sample) -> bool:
        """Log it. Returns False, so that it can be used in a condition."""
        where = f"{sample.where}: " if sample.where else ""
        self._bad.add(what, f"{where}{what} is left out: it is not valid Unicode (half of a surrogate pair)")
        return False


# --- samples that were delayed on their way

PAUSE_S = 0.5  # a pause: no sample for this long, and
PAUSE_PERIODS = 2.0  # for this many times the interval before it
LATE_S = 0.1  # a sample is new if its delay has grown by no more than this
HOLD_S = 1.0  # the longest check after a pause; then the robot's clock must have stopped too


class Backlog:
    """Recognises samples of one source that were delayed on their way to the agent. Times are seconds of
    kit.now_s(), except for robot time.

    After a pause of the source or of this process (a stalled link, SIGSTOP), pipes and sockets still hold
    samples from before the pause, which then arrive all at once. The robot's clock reveals them: between an
    old sample and its predecessor, less robot time has passed than real time.

    A robot's clock may also stop and jump, so it is used only right after a pause.
    """

    def __init__(self) -> None:
        self._came_s: float | None = None
        self._interval_s = math.inf
        self._offset_s = 0.0  # arrival − robot time of the newest sample that was not old
        self._pause_s = 0.0  # 0: no check under way
        self._since_s = 0.0  # arrival of the first sample after the pause

    def is_old(self, t_s: float, now_s: float) -> bool:
        """Whether the sample of robot time `t_s`, which arrives at `now_s`, was sent long ago."""
        if not math.isfinite(t_s):
            return False
        before_s, self._came_s = self._came_s, now_s
        offset_s = now_s - t_s
        if before_s is not None:
            gap_s = now_s - before_s
            if not self._pause_s and gap_s > max(PAUSE_S, PAUSE_PERIODS * self._interval_s):
                self._pause_s, self._since_s = gap_s, now_s
            self._interval_s = gap_s
        if self._pause_s:
            late_s = offset_s - self._offset_s
            # no sample can be delayed by more than the pause: then the robot's clock stepped
            if LATE_S < late_s < self._pause_s + LATE_S and now_s - self._since_s < HOLD_S:
                return True
            self._pause_s = 0.0
        self._offset_s = offset_s
        return False
