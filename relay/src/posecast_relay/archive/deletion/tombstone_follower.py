"""Follows the tombstones of a store, so that this process learns of deletions within seconds.

A process that records also executes them, and finishes those that another process left undone.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable

from posecast_relay.archive.background_trouble import BackgroundTrouble
from posecast_relay.archive.deletion.eraser import Erased, erase
from posecast_relay.archive.deletion.tombstones import (
    KEPT_MS,
    get_tombstone,
    list_tombstones,
    put_done,
    read_age_ms,
    remove_tombstone,
)
from posecast_relay.archive.names import PageKey
from posecast_relay.archive.object_store import ArchiveError, ObjectStore
from posecast_relay.kit import write_count
from posecast_relay.past.deletions import Deletion, Deletions

log = logging.getLogger("posecast_relay")

EVERY_S = 3.0
SETTLED_MS = 60_000  # after this every process has complied, and pending writes have reached the store
READ_AT_ONCE = 16
CLOCKS_APART_MS = 60_000  # the largest expected clock difference to the machine that ordered a deletion


class TombstoneFollower:
    """Adds a store's tombstones to `deletions`.

    `erases`: also deletes what they cover, then calls `sweep` with the robot; a gateway only reads.
    `compute_unix_ms`: returns the time now.
    """

    def __init__(
        self,
        store: ObjectStore,
        deletions: Deletions,
        compute_unix_ms: Callable[[], int],
        *,
        erases: bool,
        sweep: Callable[[str], Awaitable[None]] | None = None,
        mend: Callable[[PageKey], None] | None = None,
        trouble: BackgroundTrouble | None = None,
    ) -> None:
        """`mend` gets each ten minutes whose index needs repair; None: repair it here. `trouble` is told
        whether the store works.
        """
        self._store = store
        self._deletions = deletions
        self._compute_unix_ms = compute_unix_ms
        self._erases = erases
        self._sweep = sweep
        self._mend = mend
        self._trouble = trouble or BackgroundTrouble()
        self._read: dict[str, Deletion | None] = {}  # by key; None: invalid, or early
        self._early: dict[str, Deletion] = {}  # by key: those that this machine's clock has yet to reach
        self._erased: set[str] = set()  # keys of those that were executed here
        self._erasing: asyncio.Task[None] | None = None

    async def run(self) -> None:
        """Follow until cancelled. Retries while the store is away."""
        try:
            while True:
                try:
                    await self.look()
                    self._trouble.note_success("deletions ordered")
                except ArchiveError as e:
                    self._trouble.note_failure("deletions ordered", str(e))
                except Exception as e:  # a bug of ours
                    log.error("tombstones", exc_info=e)
                await asyncio.sleep(EVERY_S)
        finally:
            if self._erasing is not None:
                self._erasing.cancel()

    async def look(self) -> None:
        """Read new tombstones, and start to execute them. Raises ArchiveError."""
        names = await list_tombstones(self._store)
        self._read = {stem: self._read[stem] for stem in names.all if stem in self._read}
        new = [stem for stem in names.all if stem not in self._read]
        for at in range(0, len(new), READ_AT_ONCE):
            await asyncio.gather(*(self._take(stem) for stem in new[at : at + READ_AT_ONCE]))
        self._early = {stem: of for stem, of in self._early.items() if stem in self._read}
        for stem in [stem for stem, of in self._early.items() if not self._is_early(of)]:
            self._obey(stem, self._early.pop(stem))
        if not self._erases or (self._erasing is not None and not self._erasing.done()):
            return
        open_ = [(stem, of) for stem in names.all if stem not in names.done and (of := self._read.get(stem))]
        old = [stem for stem in names.all if read_age_ms(stem, self._compute_unix_ms()) > KEPT_MS]
        self._erased.intersection_update(names.all)
        due = [(stem, of) for stem, of in open_ if stem not in self._erased or self._is_settled(stem)]
        if due or old:
            self._erasing = asyncio.create_task(self._carry_out(due, old), name="deletions in the store")

    def _is_settled(self, stem: str) -> bool:
        return read_age_ms(stem, self._compute_unix_ms()) >= SETTLED_MS

    async def _take(self, stem: str) -> None:
        try:
            deletion = await get_tombstone(self._store, stem)
        except ValueError as e:
            log.warning("tombstones: skipped: %s: %.200s", stem, e)
            self._read[stem] = None
            return
        if deletion is None:  # gone, or not there yet
            return
        if self._is_early(deletion):
            log.warning("tombstones: postponed: %s: its end is in the future by this machine's clock", stem)
            self._read[stem], self._early[stem] = None, deletion
        else:
            self._obey(stem, deletion)

    def _is_early(self, deletion: Deletion) -> bool:
        # obeyed now, an order by a wrong clock would delete everything recorded until that time
        return deletion.to_ms > self._compute_unix_ms() + CLOCKS_APART_MS

    def _obey(self, stem: str, deletion: Deletion) -> None:
        self._read[stem] = deletion
        self._deletions.add(deletion)

    async def _carry_out(self, due: list[tuple[str, Deletion]], old: list[str]) -> None:
        """Execute deletions while `look` goes on, so that new ones take effect meanwhile."""
        try:
            for stem, deletion in due:
                settled = self._is_settled(stem)
                erased = await erase(self._store, deletion, mend=self._mend)
                if erased != Erased(0, 0):
                    count = write_count(erased.segments, "segment")
                    log.warning("past delete: %s: deleted %s from the store", stem, count)
                if self._sweep is not None:
                    await self._sweep(deletion.robot)
                self._erased.add(stem)
                if settled:  # no more of its data can arrive
                    await put_done(self._store, stem)
            for stem in old:
                await remove_tombstone(self._store, stem)
            self._trouble.note_success("deletions")
        except ArchiveError as e:  # the next look tries again
            self._trouble.note_failure("deletions", str(e))
        except Exception as e:  # a bug of ours
            log.error("deletions in the store", exc_info=e)
