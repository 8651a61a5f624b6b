"""Remembers for some seconds which files from robots were refused, so that they are not fetched again.

The relay notices a wrong file only after it has crossed the robot's uplink. Without this memory, repeated
requests for such a file would fill the uplink.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable

REFUSED_S = 15.0  # a repaired robot waits this long, unless its manifest has changed
REFUSED_MAX = 4096  # as many as a manifest has files, each under 1 kB; then the oldest is forgotten


class RefusalMemory:
    """Remembers by name why something was refused. `now` is a clock in seconds."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._kept: dict[Hashable, tuple[float, str]] = {}  # until when, and why; oldest first

    def keep(self, name: Hashable, why: str) -> None:
        """Remember for REFUSED_S seconds why `name` was refused, in one line."""
        self._kept.pop(name, None)
        if len(self._kept) >= REFUSED_MAX:
            del self._kept[next(iter(self._kept))]
        self._kept[name] = self._now() + REFUSED_S, why

    def find(self, name: Hashable) -> tuple[str, float] | None:
        """Return why `name` was refused and for how many more seconds; None if it is not refused now."""
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
        """Return how many refusals are stored, including expired ones."""
        return len(self._kept)
