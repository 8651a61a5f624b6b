"""Source `wave:HZ`: a knee that swings."""

from __future__ import annotations

import math
import threading

from posecast_edge import kit
from posecast_edge.profile.types import Profile
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.base import Deliver, Source


def open_source(address: str, profile: Profile | None) -> Source:
    """Open the source. Raises SourceError when the address is no frequency."""
    del profile
    if not address.isdigit():
        raise SourceError(f"wave: use a frequency in Hz, not {address!r}")
    return Wave(int(address))


class Wave:
    """One joint, a sine."""

    description = "a knee that swings"

    def __init__(self, hz: int) -> None:
        self._hz = hz

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver 100 samples a second until `stop` is set."""
        while not stop.wait(0.01):
            t_s = kit.now_s()
            angle = 0.5 + 0.4 * math.sin(2 * math.pi * self._hz * t_s)
            deliver(Sample(t_s, {"pos": {"knee": angle}}))
