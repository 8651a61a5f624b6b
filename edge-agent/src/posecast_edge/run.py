"""One run of the agent: who sends, and when since it began."""

from __future__ import annotations

import os
import time

from posecast_wire.keys import Stamp


class Run:
    """A random id, never ordered by value: a robot may boot in 1970, and two agents may claim one robot."""

    def __init__(self) -> None:
        self.id = int.from_bytes(os.urandom(8), "big") or 1
        self._start_ns = time.monotonic_ns()

    def stamp(self) -> Stamp:
        """The attachment of what is sent now."""
        return Stamp(self.id, time.monotonic_ns() - self._start_ns)
