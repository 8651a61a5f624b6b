"""Turns samples into one view's frames: its stream, its pacing, and the order of its frames. Does no I/O."""

from __future__ import annotations

import math
import threading

from posecast_edge.pipeline.stream import Stream

# A sample delayed by more than this, in addition to its pacing, is not sent: the link was down or this
# process was paused. Viewers would mistake it for a new one.
OLD_S = 0.5


class ViewPipeline:
    """State of one view. `stream` is None until the first sample of a robot without a profile."""

    def __init__(self, view: str, hz: float, stream: Stream | None, now_s: float) -> None:
        self.view = view
        self.hz = hz  # at most
        self.stream = stream
        self.pacer = FramePacer(hz, now_s)
        self.at_once = False  # send a frame regardless of the pace
        self.lock = threading.Lock()  # frames are sent one at a time, in the order of their numbers
        self.ended = False

    def compute_rest_s(self, now_s: float) -> float:
        """Seconds until a frame is due if nothing changes; 0: a frame is due now."""
        if self.at_once:
            return 0.0
        return self.pacer.compute_wait_s(now_s) if self.stream and self.stream.fresh else math.inf

    def compute_oldest_s(self, now_s: float) -> float:
        """Samples taken before this time, in seconds, are too old to be sent now."""
        return now_s - OLD_S - self.pacer.longest_s

    def end(self) -> None:
        """Stop sending. After this returns, no frame is being sent or will be sent."""
        with self.lock:
            self.ended = True

    def record_frame(self, now_s: float, most_hz: float) -> None:
        """Record that a frame is sent at `now_s`, and limit the rate to `most_hz`."""
        self.at_once = False
        self.pacer.hz = min(self.hz, most_hz)
        self.pacer.record_frame(now_s)


# --- pacing

EARLY = 1 / 8  # of the interval: a sample that arrives this little early is sent
# Of the interval: how long a due frame waits for a newer sample. More than one interval: otherwise every
# sample of a source slightly faster than `hz` would be delayed, instead of one in hundreds skipped.
LATE = 5 / 4


class FramePacer:
    """Decides when the frames of one stream are sent: when a sample arrives, and at most at the requested
    rate. Times are monotonic seconds; `hz` may change at any time.

    A timer that ignores the samples would send samples of any age up to the source's period. So a due frame
    waits for the next sample. If none arrives in time, the newest sample is sent.
    """

    def __init__(self, hz: float, now_s: float) -> None:
        self.hz = hz
        self._next_s = now_s

    @property
    def from_s(self) -> float:
        """Time from which an arriving sample is sent at once."""
        return self._next_s - EARLY / self.hz

    @property
    def longest_s(self) -> float:
        """The longest time that a sample waits, in seconds."""
        return (1 + LATE) / self.hz

    def is_due(self, now_s: float) -> bool:
        """Whether a sample that arrives at `now_s` should be sent as a frame at once."""
        return now_s >= self.from_s

    def compute_wait_s(self, now_s: float) -> float:
        """How many more seconds a waiting sample is held if no newer one arrives; 0: send it now."""
        return max(0.0, self._next_s + LATE / self.hz - now_s)

    def record_frame(self, now_s: float) -> None:
        """Record that a frame is sent at `now_s`. A late frame does not make the next one earlier."""
        self._next_s = max(self._next_s + 1 / self.hz, now_s)
