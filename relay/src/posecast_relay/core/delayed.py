"""The delayed hub shows robots with a delay. It reads from one bounded buffer per robot and view.

A ring entry refers to what the stream held at that moment, so an entry costs only its newest frame. A full
ring skips new entries until it has room. The next entry then carries the complete state and all events since
the last entry.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

from posecast_wire import Schema, Snapshot, Stamp

from posecast_relay.core.actions import Action
from posecast_relay.core.hub import Headcount, Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.replica import ReplicaFeed, adopt_run
from posecast_relay.core.stream import Event, StoredFrame, Stream
from posecast_relay.kit import NEVER

ENTRIES_MAX = 4000  # one minute at 60 Hz, with its events
BYTES_MAX = 16_000_000


@dataclass(slots=True)
class _Moment:
    """A snapshot of a stream. `live`: its newest frame had just arrived."""

    at: float
    token: bool
    schema: Schema | None
    info: dict[str, str]
    model: str | None
    key: StoredFrame | None
    newest: StoredFrame | None
    live: bool
    late_s: float
    numbering: str
    events: list[Event]

    @property
    def size(self) -> int:
        """Bytes that belong to this entry alone."""
        frame = len(self.newest.payload) if self.newest and self.live else 0
        return 200 + frame + sum(len(event.text) for event in self.events)


class _Ring:
    """The delayed entries of one robot and view."""

    def __init__(self, delay_s: float) -> None:
        self.delay_s = delay_s
        self.left_out = 0
        self._moments: deque[_Moment] = deque()
        self._bytes = 0
        self._newest: StoredFrame | None = None
        self._numbering = ""
        self._event_n = 0
        # what the delayed hub got last
        self.fed: _Moment | None = None
        self.fed_key: StoredFrame | None = None

    def put(self, stream: Stream, token: bool, now: float) -> None:
        """Add the stream's current state."""
        if stream.numbering != self._numbering:
            self._numbering, self._event_n = stream.numbering, 0
        moment = _Moment(
            at=now,
            token=token,
            schema=stream.schema,
            info=stream.info,
            model=stream.model,
            key=stream.key,
            newest=stream.newest,
            live=stream.newest is not self._newest and stream.live_at is not None,
            late_s=stream.compute_age_s(now) or 0.0,
            numbering=stream.numbering,
            events=[event for event in stream.events if event.n > self._event_n],
        )
        if len(self._moments) >= ENTRIES_MAX or self._bytes + moment.size > BYTES_MAX:
            self.left_out += 1
            return
        self._moments.append(moment)
        self._bytes += moment.size
        self._newest = stream.newest
        self._event_n = stream.event_n

    @property
    def next_at(self) -> float:
        """When the oldest entry is due."""
        return self._moments[0].at + self.delay_s if self._moments else NEVER

    def take(self, now: float) -> _Moment | None:
        """Remove and return the oldest entry if it is due."""
        if now < self.next_at:
            return None
        moment = self._moments.popleft()
        self._bytes -= moment.size
        return moment


class DelayedHub(Hub):
    """A hub that shows robots with a delay. Viewers join it like any other hub."""

    def __init__(self, limits: Limits, headcount: Headcount | None = None) -> None:
        super().__init__(limits, headcount)
        self._rings: dict[tuple[str, str], _Ring] = {}
        self._replica = ReplicaFeed(self)

    def set_delays(self, delays_s: Mapping[tuple[str, str], float]) -> None:
        """Set which robots and views are buffered, and their delays in seconds. All others are dropped."""
        for name in self._rings.keys() - delays_s.keys():
            del self._rings[name]
        for name, delay_s in delays_s.items():
            ring = self._rings.get(name)
            if ring is None:
                self._rings[name] = _Ring(delay_s)
            else:
                ring.delay_s = delay_s

    @property
    def left_out(self) -> int:
        """How many states were skipped because their buffer was full."""
        return sum(ring.left_out for ring in self._rings.values())

    def list_robots(self) -> set[str]:
        """Return the names of the robots that are shown with a delay."""
        return {robot for robot, _ in self._rings}

    def record_stream(self, stream: Stream, token: bool, now: float) -> bool:
        """Record the state of a stream that has changed.

        Returns False if the stream is not delayed. Otherwise call `tick` by `wake_at`.
        """
        ring = self._rings.get((stream.robot, stream.view))
        if ring is None:
            return False
        ring.put(stream, token, now)
        self.wake_at = min(self.wake_at, ring.next_at)
        return True

    def tick(self, now: float, unix_s: float) -> list[Action]:
        """Replay the recorded states that are due, then do the work of any hub."""
        out: list[Action] = []
        for (robot, view), ring in self._rings.items():
            while (moment := ring.take(now)) is not None:
                out += self.guard(None, partial(self._replay, robot, view, ring, moment, now, unix_s))
        if self.changed:
            out += self.flush(now, unix_s)
        out += super().tick(now, unix_s)
        self.wake_at = min(self.wake_at, *(ring.next_at for ring in self._rings.values()), NEVER)
        return out

    def _replay(
        self, robot: str, view: str, ring: _Ring, moment: _Moment, now: float, unix_s: float
    ) -> list[Action]:
        out: list[Action] = []
        before = ring.fed
        if before is None or before.token != moment.token:
            out += self.set_token(robot, moment.token, now)
        if moment.schema is not None and moment.key is not None and moment.newest is not None:
            self._replay_frame(robot, view, ring, moment, now)
        if moment.events:
            out += self.flush(now, unix_s)  # send first the state in which the events happened
            for event in moment.events:
                out += self._replica.take_event(robot, view, moment.numbering, event.text)
        ring.fed = moment
        return out

    def _replay_frame(self, robot: str, view: str, ring: _Ring, moment: _Moment, now: float) -> None:
        newest, key, before = moment.newest, moment.key, ring.fed
        assert newest is not None
        assert key is not None
        assert moment.schema is not None
        told = before is not None and before.schema is moment.schema
        told = told and before is not None and (before.info, before.model) == (moment.info, moment.model)
        coming = newest if moment.live else None  # a frame from a snapshot is never sent alone
        stamp = Stamp(newest.run_id, round(newest.stamp_s * 1e9))
        of = self.admit_robot(robot)
        if of is not None:  # otherwise none of it is used
            adopt_run(of, newest.run_id, now)  # the live hub has already decided which run is current
            if moment.live:  # it also measured the lateness; it is too late to ask the edge
                of.runs.record_answer(stamp, moment.late_s, now)
        if not told or key not in (ring.fed_key, coming):
            snapshot = Snapshot(moment.schema.text, moment.info, key.payload, moment.model)
            # without it a KEY would be shown as the picture, however old it is
            picture = None if moment.live else newest.payload
            try:
                self.take_snapshot(robot, view, snapshot, stamp, now, picture)
            except ValueError:  # can't happen: the stream itself accepted it
                self.outcomes["bad"] += 1
                return
        if moment.live:
            self.receive_frame(robot, view, newest.payload, stamp, now, moment.late_s)
            room = self.robots[robot].rooms.get(view)
            if room is not None:
                room.stream.set_age_unless_live(
                    moment.late_s, now
                )  # includes a KEY that came with the snapshot
        ring.fed_key = key
