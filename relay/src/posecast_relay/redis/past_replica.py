"""A gateway's copy of one view's records in Redis, as of the last read."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from posecast_relay.core.past.kept_segment import KeptSegment, SegmentName
from posecast_relay.core.past.memory_store import MemoryPast
from posecast_relay.core.past.segment_record import unpack_record

BEGINNING = b"-"
UNBOUNDED = 1 << 62  # the owner of the replicas bounds them together


class PastReplica:
    """A view's records, without the segments' bytes. `pass_over` is called with the reason when a record is
    skipped; deleted records are skipped silently.
    """

    def __init__(
        self,
        robot: str,
        view: str,
        pass_over: Callable[[str], None],
        is_deleted: Callable[[KeptSegment], bool] = lambda _segment: False,
    ) -> None:
        self.kept = MemoryPast(UNBOUNDED)
        self.looked_at = float("-inf")  # seconds of the core's clock
        self._robot = robot
        self._view = view
        self._pass_over = pass_over
        self._is_deleted = is_deleted
        self._rows: deque[tuple[bytes, SegmentName | None]] = deque()  # None: skipped

    @property
    def newest(self) -> bytes:
        """The id after which to look for new records."""
        return self._rows[-1][0] if self._rows else BEGINNING

    @property
    def count(self) -> int:
        """How many records it has, including skipped ones."""
        return len(self._rows)

    def note_look(self, at_s: float) -> None:
        """Note when it was last compared with Redis; minus infinity: compare it before use."""
        self.looked_at = at_s

    def append(self, told: Sequence[bytes]) -> bool:
        """Append alternating ids and records. Returns whether any was a segment."""
        found = False
        for id_, record in zip(told[::2], told[1::2], strict=True):
            try:
                segment = unpack_record(self._robot, self._view, record)
                if self._is_deleted(segment):  # Redis is about to delete it, too
                    self._rows.append((id_, None))
                    continue
                self.kept.add(segment, 0.0)
            except ValueError as e:
                self._pass_over(str(e))
                self._rows.append((id_, None))
            else:
                self._rows.append((id_, segment.name))
                found = True
        return found

    def drop_before(self, oldest: bytes) -> None:
        """Drop the records older than this id."""
        first = _order(oldest)
        while self._rows and _order(self._rows[0][0]) < first:
            _, name = self._rows.popleft()
            if name is not None and self.kept.find(name) is not None:
                self.kept.drop_oldest(self._robot)

    def drop(self, name: SegmentName) -> None:
        """Drop one segment because it is gone or damaged."""
        segments = self.kept.list_segments(self._robot, self._view)
        self.kept = MemoryPast(UNBOUNDED)
        for segment in segments:
            if segment.name != name:
                self.kept.add(segment, 0.0)


def _order(id_: bytes) -> tuple[int, int]:
    """Return a stream id as a sortable pair."""
    ms, _, n = id_.partition(b"-")
    return int(ms), int(n or b"0")
