"""Watches how much space is left where a file store lies, and says so before it is full."""

from __future__ import annotations

import logging

from posecast_relay.archive.object_store import ArchiveError, FreeSpace, ObjectStore

log = logging.getLogger("posecast_relay")

LEAST_SHARE, LEAST_BYTES = 0.1, 1 << 30  # below either of these it is said
CALM = 1.2  # so many times as much, and all is well again


class SpaceWatch:
    """What is left where a store lies; known for a folder only."""

    def __init__(self, store: ObjectStore, least_bytes: int = LEAST_BYTES) -> None:
        self.space: FreeSpace | None = None
        self._store = store
        self._least_bytes = least_bytes
        self._is_low = False

    async def look(self) -> None:
        """Measure, and write a line to the log when it has become low, or is no more."""
        try:
            self.space = await self._store.measure_free()
        except ArchiveError:
            return  # whoever writes says so
        if self.space is None:
            return
        low = self._is_below(CALM if self._is_low else 1.0)
        if low != self._is_low:
            self._is_low = low
            left = self.space.free >> 20
            share = 100 * self.space.free / max(1, self.space.total)
            log.warning(
                "the archive: %s: %d MB (%d %%) are left",
                "the disk is nearly full" if low else "the disk has room again",
                left,
                share,
            )

    def find_trouble(self) -> str | None:
        """Return that little is left; None when there is enough, or nobody knows."""
        if not self._is_low or self.space is None:
            return None
        return f"the disk is nearly full: {100 * self.space.free // max(1, self.space.total)} % is left"

    def _is_below(self, factor: float) -> bool:
        assert self.space is not None
        free, total = self.space
        return free < factor * LEAST_SHARE * total or free < factor * self._least_bytes
