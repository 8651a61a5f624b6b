"""Remembers for some seconds what robots have sent and the relay has refused, so that it is not sent again.

A file that is not what its manifest says crosses the robot's uplink whole before that is known. Without this,
whoever asks for it again and again fills the uplink.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable

REFUSED_S = 15.0  # a robot that has been mended meanwhile waits so long; it need not, with another manifest
REFUSED_MAX = 4096  # as many as a manifest has files, each less than 1 kB; beyond, the oldest is forgotten


class RefusalMemory:
    """Remembers why something was refused, by its name. `now` is a clock in seconds."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._kept: dict[Hashable, tuple[float, str]] = {}  # until when, and why; the oldest first

    def keep(self, name: Hashable, why: str) -> None:
        """Remember from now on, for REFUSED_S seconds, why `name` was refused, in one line."""
        self._kept.pop(name, None)
        if len(self._kept) >= REFUSED_MAX:
            del self._kept[next(iter(self._kept))]
        self._kept[name] = self._now() + REFUSED_S, why

    def find(self, name: Hashable) -> tuple[str, float] | None:
        """Return why `name` was refused and how many seconds that counts for yet; None when it does not."""
        kept = self._kept.get(name)
        if kept is None:
            return None
        until, why = kept
        left_s = until - self._now()
        if left_s > 0:
            return why, left_s
        del self._kept[name]
        return None

    def __len__(self) -> int:
        """How many are remembered, those included whose time has passed unasked."""
        return len(self._kept)
