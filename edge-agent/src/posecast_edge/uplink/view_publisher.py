"""Publishes one view: queues data until the relay listens, and decides the order of sending."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable
from typing import cast

import zenoh
from posecast_wire.keys import Snapshot, event_key, frame_key, snapshot_key

from posecast_edge import kit
from posecast_edge.kit import ExceptionLog, TokenBucket
from posecast_edge.pipeline.events import Event
from posecast_edge.uplink.run import Run

EVENTS_MAX = 100  # waiting for the link; the oldest is dropped first. The relay keeps as many
INFO_EVERY_S = 0.5  # texts that change more often are sent together
SNAPSHOTS_S = 10.0  # answers a second: a relay asks once a second, and there may be several relays;
SNAPSHOTS_AT_ONCE = 20.0  # a burst may have this many
KEY_FIRST_S = 1.0  # how long events wait for the KEY that makes the relay switch to this run
RETRY_S = 0.1  # after a failed attempt to send, unless there is a new link before

Waiting = Event | dict[str, str] | str  # an event, info, or the hash of a model


class ViewPublisher:
    """Frames, events and the snapshot of one view. The publisher's lock guards what is waiting."""

    def __init__(
        self,
        robot: str,
        view: str,
        run: Run,
        snapshot: Callable[[], Snapshot | None],
        heard: Callable[[], None],
        exceptions: ExceptionLog,
    ) -> None:
        """`snapshot` and `heard` are called by Zenoh's threads; `heard` when a relay starts to listen."""
        self.view = view
        self.events: deque[Event] = deque(maxlen=EVENTS_MAX)
        self.info: dict[str, str] | None = None  # the newest only
        self.model: str | None = None  # the newest hash only
        self._robot, self._run = robot, run
        self._snapshot, self._heard, self._exceptions = snapshot, heard, exceptions
        self._bucket = TokenBucket(SNAPSHOTS_S, SNAPSHOTS_AT_ONCE)
        self._answer: tuple[Snapshot, bytes] | None = None  # the newest, packed
        self._info_sent_s = self._failed_s = float("-inf")
        self._frames: zenoh.Publisher | None = None
        self._events: zenoh.Publisher | None = None
        self._matched = False
        self._heard_s = 0.0
        self._frame_since_heard = False

    def declare(self, session: zenoh.Session) -> list[object]:
        """Declare this view's Zenoh entities. The caller must keep the returned objects alive."""
        self._failed_s = float("-inf")
        self._frames = frames = session.declare_publisher(
            frame_key(self._robot, self.view),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME,
        )
        self._events = session.declare_publisher(
            event_key(self._robot, self.view),
            reliability=zenoh.Reliability.RELIABLE,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )
        on_matching = self._exceptions.guard(f"the link of {self.view}", self._on_matching)
        on_snapshot = self._exceptions.guard(f"a snapshot of {self.view}", self._on_snapshot)
        listener = frames.declare_matching_listener(on_matching)
        on_matching(_matching(frames))  # it may have matched before the listener was set
        return [listener, session.declare_queryable(snapshot_key(self._robot, self.view), on_snapshot)]

    def close(self) -> None:
        """Drop the publishers of a lost link. No more frames are sent."""
        self._frames = self._events = None
        self._matched = False

    @property
    def declared(self) -> bool:
        """Whether there is a link to publish this view's frames on."""
        return self._frames is not None

    @property
    def has_listener(self) -> bool:
        """Whether a relay subscribes to this view; only then does a frame leave the machine. `heard` is
        called before this is first true, so that the first frame is a KEY."""
        if not self._matched and self._frames is not None:
            self._on_matching(_matching(self._frames))  # Zenoh's thread may report it late
        return self._matched

    def send_frame(self, data: bytes, taken_s: float) -> None:
        """Send a frame, or discard it when there is no link. `taken_s`: when its sample came from the source,
        seconds."""
        frames = self._frames
        if frames is not None:
            frames.put(data, attachment=self._run.make_stamp(taken_s).pack())
            self._frame_since_heard = True

    @property
    def waiting(self) -> bool:
        """Whether an event, a change of model or info has yet to be sent."""
        return bool(self.events) or self.model is not None or self.info is not None

    @property
    def _info_is_due(self) -> bool:
        return self.info is not None and kit.now_s() - self._info_sent_s >= INFO_EVERY_S

    @property
    def ready(self) -> bool:
        """Whether waiting data may be sent now: the relay listens and a KEY has been sent first."""
        if not (self.events or self.model is not None or self._info_is_due):
            return False
        if kit.now_s() - self._failed_s < RETRY_S:
            return False
        if self._events is None or not _matching(self._events).matching:
            return False
        return self._frame_since_heard or kit.now_s() - self._heard_s > KEY_FIRST_S

    def find_next(self) -> Waiting:
        """The item to send next. It stays in its place until `remove`. Call it only while `ready`."""
        if self.info is not None and self._info_is_due:
            return self.info
        return self.events[0] if self.model is None else self.model

    def send(self, item: Waiting) -> None:
        """Send an item; called without the lock. Raises ZError when the link is broken, ValueError when the
        item can't be sent on any link."""
        publisher = self._events
        assert publisher is not None
        if isinstance(item, Event):
            document = make_event_document(item)
        elif isinstance(item, str):
            document = {"type": "model", "hash": item}
        else:
            document = {"type": "info", "kv": item}
        text = json.dumps(document, ensure_ascii=False, separators=(",", ":"))
        publisher.put(text.encode(), attachment=self._run.make_stamp().pack())

    def remove(self, item: Waiting) -> None:
        """Forget an item that was sent, unless a newer one has taken its place meanwhile."""
        if item is self.info:
            self.info, self._info_sent_s = None, kit.now_s()
        elif item is self.model:
            self.model = None
        elif self.events and item is self.events[0]:
            self.events.popleft()

    def postpone(self) -> None:
        """Keep what is waiting, in its order, until RETRY_S from now or until there is a new link."""
        self._failed_s = kit.now_s()

    def _on_matching(self, status: zenoh.MatchingStatus) -> None:
        newly = status.matching and not self._matched
        self._matched = status.matching
        if newly:
            self._heard_s, self._frame_since_heard = kit.now_s(), False
            self._heard()

    def _on_snapshot(self, query: zenoh.Query) -> None:
        with query:
            if not self._bucket.take(kit.now_s()):
                return
            snapshot = self._snapshot()
            if snapshot is None:
                query.reply_err(b"no sample yet")
                return
            if self._answer is None or self._answer[0] != snapshot:
                self._answer = snapshot, snapshot.pack()
            stamp = self._run.make_stamp().pack()
            query.reply(snapshot_key(self._robot, self.view), self._answer[1], attachment=stamp)


def _matching(publisher: zenoh.Publisher) -> zenoh.MatchingStatus:
    return cast(zenoh.MatchingStatus, publisher.matching_status)  # zenoh's stub says bool; it is not


def make_event_document(event: Event) -> dict[str, object]:
    """The event as the relay reads it, before it is encoded as JSON."""
    return {
        "type": "event",
        "t": event.t_s,
        "level": event.level,
        "source": event.source,
        "text": event.text,
        "state": "on" if event.on else "off",
    }
