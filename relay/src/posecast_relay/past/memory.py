"""The past in this process's own memory: one limit in bytes for the process, shared fairly among robots."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from itertools import chain

from posecast_relay.past.deletions import Deletion
from posecast_relay.past.segment import PAGE_MS, KeptSegment, SegmentName, TakeSpan
from posecast_relay.past.source import ListWaiting, RecentOnly, Wake

Listener = Callable[[KeptSegment], None]


class _SchemaText:
    """A schema's text, kept while a segment names it."""

    __slots__ = ("named", "text")

    def __init__(self, text: str) -> None:
        self.text = text
        self.named = 0  # how many segments name it


class _Shelf:
    """The segments of one robot, oldest first."""

    def __init__(self) -> None:
        self.bytes = 0
        self.views: dict[str, deque[KeptSegment]] = {}
        self.added_at: dict[str, deque[float]] = {}  # when each of those was added
        self.pages: dict[tuple[str, int], deque[KeptSegment]] = {}  # the same segments by view and page
        self.takes: dict[tuple[str, int], TakeSpan] = {}  # by view and take, in the order in which they began
        self.schemas: dict[tuple[str, bytes], _SchemaText] = {}  # by view and SHA-256

    def put(self, segment: KeptSegment, now: float) -> None:
        """Add the newest segment."""
        view = segment.name.view
        self.views.setdefault(view, deque()).append(segment)
        self.added_at.setdefault(view, deque()).append(now)
        self.pages.setdefault((view, segment.from_ms // PAGE_MS), deque()).append(segment)
        take, index = segment.name.take, segment.name.index
        span = self.takes.get((view, take))
        self.takes[view, take] = TakeSpan(take, index if span is None else span.first_index, index)
        self.bytes += segment.cost_bytes
        if segment.schema is not None and segment.schema_text is not None:
            schema = self.schemas.get((view, segment.schema))
            if schema is None:
                schema = self.schemas[view, segment.schema] = _SchemaText(segment.schema_text)
                self.bytes += len(schema.text)
            schema.named += 1

    def find_oldest_view(self) -> str:
        """Return the view with the segment that was added first."""
        return min(self.added_at, key=lambda view: self.added_at[view][0])

    def take_oldest(self, view: str) -> KeptSegment:
        """Remove the oldest segment of a view, and its schema if no other segment names it."""
        segment = self.views[view].popleft()
        self.added_at[view].popleft()
        if not self.views[view]:
            del self.views[view], self.added_at[view]
        of_page = self.pages[view, segment.from_ms // PAGE_MS]
        of_page.popleft()  # the same segment: both are in the same order
        if not of_page:
            del self.pages[view, segment.from_ms // PAGE_MS]
        span = self.takes[view, segment.name.take]
        if segment.name.index >= span.last_index:
            del self.takes[view, span.take]
        else:
            self.takes[view, span.take] = span._replace(first_index=segment.name.index + 1)
        self.bytes -= segment.cost_bytes
        schema = self.schemas.get((view, segment.schema)) if segment.schema is not None else None
        if schema is not None and segment.schema is not None and segment.schema_text is not None:
            schema.named -= 1
            if not schema.named:
                del self.schemas[view, segment.schema]
                self.bytes -= len(schema.text)
        return segment


class MemoryPast:
    """Keeps closed segments. While they exceed `bytes_max` in total, the robot that uses the most loses its
    oldest.
    """

    def __init__(self, bytes_max: int) -> None:
        self.bytes_max = bytes_max
        self.bytes = 0  # in use now
        self.added = 0  # segments, since the process started
        self.crowded_out = 0  # segments dropped early to free memory
        self.crowded = Counter[str]()  # segments dropped early, by robot
        self._shelves: dict[str, _Shelf] = {}  # by robot
        self._named: dict[SegmentName, KeptSegment] = {}
        self._listeners: dict[Listener, None] = {}

    def compute_reach_s(self, robot: str, now: float) -> float:
        """Return for how many seconds a robot's oldest segment has been here; 0 if it has none."""
        shelf = self._shelves.get(robot)
        return 0.0 if shelf is None else now - min(added_at[0] for added_at in shelf.added_at.values())

    def __len__(self) -> int:
        """How many segments are kept."""
        return len(self._named)

    def add(self, segment: KeptSegment, now: float) -> None:
        """Keep a segment that has just closed, and tell the listeners. `now`: the core's clock.

        Raises ValueError if a segment with this name is already here.
        """
        name = segment.name
        if name in self._named:
            raise ValueError(
                f"segment {name.take:016x},{name.index} of {name.robot}/{name.view}: added twice"
            )
        shelf = self._shelves.setdefault(name.robot, _Shelf())
        before = shelf.bytes
        shelf.put(segment, now)
        self.bytes += shelf.bytes - before
        self._named[name] = segment
        self.added += 1
        while self.bytes > self.bytes_max:
            crowding = max(self._shelves, key=lambda robot: self._shelves[robot].bytes)
            self.drop_oldest(crowding)
            self.crowded[crowding] += 1
            self.crowded_out += 1
        if name in self._named:
            for listener in tuple(self._listeners):
                listener(segment)

    def on_added(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with each segment added from now on, until you call the returned function.

        A listener must not raise.
        """
        self._listeners[listener] = None

        def stop() -> None:
            self._listeners.pop(listener, None)

        return stop

    def find(self, name: SegmentName) -> KeptSegment | None:
        """Return the segment with this name; None if it is not here, or no longer."""
        return self._named.get(name)

    def find_newest(self, robot: str, view: str) -> KeptSegment | None:
        """Return the segment that was added last."""
        segments = self._list_view(robot, view)
        return segments[-1] if segments else None

    def find_oldest(self, robot: str, view: str) -> KeptSegment | None:
        """Return the oldest segment that is still here, by when it was added."""
        segments = self._list_view(robot, view)
        return segments[0] if segments else None

    def list_segments(
        self, robot: str, view: str, from_ms: int = 0, to_ms: int | None = None
    ) -> list[KeptSegment]:
        """Return the segments that begin between `from_ms` and `to_ms` (exclusive), unix ms; None: no end.

        They are in the order in which they were added. After a clock was set back, that is not the order of
        `from_ms`.
        """
        return [
            segment
            for segment in self._list_pages(robot, view, from_ms, to_ms)
            if from_ms <= segment.from_ms and (to_ms is None or segment.from_ms < to_ms)
        ]

    def list_takes(self, robot: str, view: str) -> list[TakeSpan]:
        """Return the takes that have segments here, in the order in which they began.

        With a single recorder, all but the last have ended.
        """
        shelf = self._shelves.get(robot)
        return [] if shelf is None else [span for (of, _), span in shelf.takes.items() if of == view]

    def list_after(self, name: SegmentName) -> list[KeptSegment]:
        """Return the segments of the same view that were added after this one, in order; all if it is not
        here."""
        found: list[KeptSegment] = []
        for segment in reversed(self._list_view(name.robot, name.view)):
            if segment.name == name:
                break
            found.append(segment)
        return found[::-1]

    def list_robots(self) -> list[str]:
        """Return the robots that have segments."""
        return list(self._shelves)

    def list_views(self, robot: str) -> list[str]:
        """Return the views of a robot that have segments."""
        shelf = self._shelves.get(robot)
        return [] if shelf is None else list(shelf.views)

    def find_schema_text(self, robot: str, view: str, sha256: bytes) -> str | None:
        """Return the text of a schema that one of this view's segments names."""
        shelf = self._shelves.get(robot)
        schema = None if shelf is None else shelf.schemas.get((view, sha256))
        return None if schema is None else schema.text

    def forget_older(self, compute_kept_s: Callable[[str, str], float], now: float) -> None:
        """Drop the segments that are older than the retention time of their robot and view, in seconds; 0:
        all.

        Age counts from when a segment was added. With a segment's own times, a wall clock that is set back
        would keep it forever.
        """
        for robot, shelf in list(self._shelves.items()):
            for view, added_at in list(shelf.added_at.items()):
                kept_s = compute_kept_s(robot, view)
                while added_at and (kept_s <= 0 or added_at[0] < now - kept_s):
                    self._drop(robot, view)

    def drop_oldest(self, robot: str) -> None:
        """Drop the oldest segment of a robot. It must have one."""
        self._drop(robot, self._shelves[robot].find_oldest_view())

    def delete(self, deletion: Deletion) -> list[KeptSegment]:
        """Drop and return what a deletion covers, also from the middle. Takes time for all of the robot's
        segments."""
        before = self._shelves.get(deletion.robot)
        if before is None:
            return []
        gone: list[KeptSegment] = []
        after = _Shelf()
        for view, segments in before.views.items():
            for segment, added_at in zip(segments, before.added_at[view], strict=True):
                if deletion.covers_segment(segment):
                    gone.append(segment)
                    del self._named[segment.name]
                else:
                    after.put(segment, added_at)
        self.bytes += after.bytes - before.bytes
        if after.views:
            self._shelves[deletion.robot] = after
        else:
            del self._shelves[deletion.robot]
        return gone

    def _drop(self, robot: str, view: str) -> None:
        shelf = self._shelves[robot]
        before = shelf.bytes
        segment = shelf.take_oldest(view)
        self.bytes -= before - shelf.bytes
        del self._named[segment.name]
        if not shelf.views:
            del self._shelves[robot]

    def _list_pages(self, robot: str, view: str, from_ms: int, to_ms: int | None) -> Iterable[KeptSegment]:
        """Return the segments that begin in this span, and possibly others."""
        shelf = self._shelves.get(robot)
        if shelf is None or to_ms is None or (to_ms - from_ms) // PAGE_MS >= len(shelf.pages):
            return self._list_view(robot, view)
        numbers = range(from_ms // PAGE_MS, (to_ms - 1) // PAGE_MS + 1)
        return chain.from_iterable(shelf.pages.get((view, number), ()) for number in numbers)

    def _list_view(self, robot: str, view: str) -> deque[KeptSegment] | tuple[()]:
        shelf = self._shelves.get(robot)
        return () if shelf is None else shelf.views.get(view, ())


class PastByView:
    """A KeptPast whose views are each in a MemoryPast of their own."""

    def get_view(self, robot: str, view: str) -> MemoryPast:
        """Return the past of a view."""
        raise NotImplementedError

    def find(self, name: SegmentName) -> KeptSegment | None:
        """Return the segment with this name; None if it is not here."""
        return self.get_view(name.robot, name.view).find(name)

    def find_oldest(self, robot: str, view: str) -> KeptSegment | None:
        """Return the oldest segment of a view that is here, by when it was added."""
        return self.get_view(robot, view).find_oldest(robot, view)

    def list_segments(
        self, robot: str, view: str, from_ms: int = 0, to_ms: int | None = None
    ) -> list[KeptSegment]:
        """Return the segments that begin between `from_ms` and `to_ms` (exclusive), unix ms; None: no end."""
        return self.get_view(robot, view).list_segments(robot, view, from_ms, to_ms)

    def list_takes(self, robot: str, view: str) -> list[TakeSpan]:
        """Return the takes that have segments here, in the order in which they began."""
        return self.get_view(robot, view).list_takes(robot, view)

    def list_after(self, name: SegmentName) -> list[KeptSegment]:
        """Return the segments of the same view that were added after this one."""
        return self.get_view(name.robot, name.view).list_after(name)


class MemoryPastSource(RecentOnly):
    """A PastSource in this process: it never has to wait."""

    kept: MemoryPast

    def __init__(self, kept: MemoryPast) -> None:
        self.kept = kept

    @property
    def is_older(self) -> bool:
        """Whether it may hold data recorded before this process started."""
        return False

    def follow(self, _list_waiting: ListWaiting, wake: Wake) -> None:
        """Call `wake` with the robot and view of each added segment."""
        self.kept.on_added(lambda segment: wake(segment.name.robot, segment.name.view))

    def find_trouble(self) -> None:
        """Return None: memory can always be read."""

    async def refresh(self, robot: str, view: str, *, anew: bool = False) -> None:
        """Do nothing: everything is here."""

    async def load(self, segments: Sequence[KeptSegment]) -> list[KeptSegment]:
        """Return them unchanged."""
        return list(segments)

    async def load_schema(self, robot: str, view: str, sha256: bytes) -> str | None:
        """Return the text of a schema that one of a view's segments names."""
        return self.kept.find_schema_text(robot, view, sha256)
