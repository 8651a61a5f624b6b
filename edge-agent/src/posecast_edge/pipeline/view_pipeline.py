"""Turns samples into one view's frames: its stream, its pacing, and the order of its frames."""

from __future__ import annotations

import math
import threading

from posecast_edge.pipeline.pacing import FramePacer
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
