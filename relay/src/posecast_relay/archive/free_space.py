"""Watches the free space of a file store and logs a warning before it is full."""

from __future__ import annotations

import logging

from posecast_relay.archive.object_store import ArchiveError, FreeSpace, ObjectStore

log = logging.getLogger("posecast_relay")

LEAST_SHARE, LEAST_BYTES = 0.1, 1 << 30  # warn below either of these
SMALL_SHARE = 0.25  # instead of LEAST_BYTES if it is less: most of a small disk is never free
CALM = 1.2  # the warning ends at this multiple of the limit


class SpaceWatch:
    """The free space of a store; only known for a local folder."""

    def __init__(self, store: ObjectStore, least_bytes: int = LEAST_BYTES) -> None:
        self.space: FreeSpace | None = None
        self._store = store
        self._least_bytes = least_bytes
        self._is_low = False
        self._rule = ""  # the limit that was crossed

    async def look(self) -> None:
        """Measure, and log a line when space becomes low or is sufficient again."""
        try:
            self.space = await self._store.measure_free()
        except ArchiveError:
            return  # the writer reports this
        if self.space is None:
            return
        low = self._is_below(CALM if self._is_low else 1.0)
        if low != self._is_low:
            self._is_low, self._rule = low, self._find_rule()
            what = "the disk is nearly full" if low else "the disk has room again"
            log.warning("the archive: %s: %s", what, self._describe())

    def find_trouble(self) -> str | None:
        """Return a warning if little space is left; None if there is enough, or if it is unknown."""
        return f"the disk is nearly full: {self._describe()}" if self._is_low else None

    def _describe(self) -> str:
        assert self.space is not None
        free, total = self.space
        left = f"{free >> 20} MB, {100 * free // max(1, total)} % of it"
        return f"{self._rule} is left, {left}" if self._is_low else left

    def _find_rule(self) -> str:
        assert self.space is not None
        free, total = self.space
        if free >= self._least_bytes:
            return f"less than {100 * LEAST_SHARE:g} %"
        if SMALL_SHARE * total < self._least_bytes:
            return f"less than {100 * SMALL_SHARE:g} %"
        return f"less than {self._least_bytes / (1 << 30):g} GiB"

    def _is_below(self, factor: float) -> bool:
        assert self.space is not None
        free, total = self.space
        few = min(self._least_bytes, SMALL_SHARE * total)
        return free < factor * max(LEAST_SHARE * total, few)
