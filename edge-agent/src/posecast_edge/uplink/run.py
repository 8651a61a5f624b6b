"""Identifies one run of the agent and counts time since its start."""

from __future__ import annotations

import os

from posecast_wire.keys import Stamp

from posecast_edge import kit


class Run:
    """One run, with a random id. Ids have no order: a robot's clock may start in 1970, and two agents may use
    the same robot's name."""

    def __init__(self) -> None:
        self.id = int.from_bytes(os.urandom(8), "big") or 1
        self._start_ns = kit.now_ns()

    def make_stamp(self, at_s: float | None = None) -> Stamp:
        """The attachment for data that became valid at `at_s` (seconds of kit.now_s(); None: now)."""
        at_ns = kit.now_ns() if at_s is None else round(at_s * 1e9)
        return Stamp(self.id, max(0, at_ns - self._start_ns))
