"""One run of the agent: who sends, and when since it began."""

from __future__ import annotations

import os

from posecast_wire.keys import Stamp

from posecast_edge import clock


class Run:
    """A random id, never ordered by value: a robot may boot in 1970, and two agents may claim one robot."""

    def __init__(self) -> None:
        self.id = int.from_bytes(os.urandom(8), "big") or 1
        self._start_ns = clock.now_ns()

    def make_stamp(self, at_s: float | None = None) -> Stamp:
        """The attachment of what became true at `at_s` (clock.now_s()), or of what is said now."""
        at_ns = clock.now_ns() if at_s is None else round(at_s * 1e9)
        return Stamp(self.id, max(0, at_ns - self._start_ns))
