"""The only outbound link. It publishes frames and events and answers queries about its own state. It
subscribes to nothing, so no data can reach the robot.

Once a session is open, Zenoh reconnects automatically and for ever. It discards frames sent in between, so no
backlog builds up while the link is down.
"""

from __future__ import annotations

import json
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, cast

import zenoh
from posecast_wire.keys import (
    Echo,
    Snapshot,
    alive_key,
    echo_key,
    event_key,
    frame_key,
    model_key,
    snapshot_key,
)

from posecast_edge import kit
from posecast_edge.kit import ExceptionLog, TokenBucket
from posecast_edge.model.serve.bundle import Bundle
from posecast_edge.pipeline.events import Event
from posecast_edge.uplink.credentials import Certificate, Proof
from posecast_edge.uplink.lateness import LATE_S, EchoWatch, News
from posecast_edge.uplink.route import RelayRoute
from posecast_edge.uplink.session import RETRY_MS, ModelServer, ProofRotation, Run, make_zenoh_config
from posecast_edge.uplink.tunnel import Tunnel

if TYPE_CHECKING:
    from posecast_edge.pipeline.stream import Frame
    from posecast_edge.uplink.diagnosis import RefusalPatience

log = logging.getLogger("posecast_edge.link")

WHY_S = 3.0  # without a link for this long: find out why
LOOK_S = 2.0  # how often to check the session while there is nothing to send
ECHO_S = 1.0
ECHO_AGAIN_S = 0.3  # while frames are late, and
NEW_LINK_S = 5.0  # for this long on a new link, whose bandwidth is unknown
ECHO_TIMEOUT_S = 2.0
ECHO_END_S = 0.5  # how long to wait for the echo's thread; its calls to the session take less
ECHO_BYTES_MAX = 4096
ECHO_REPLIES_MAX = 8  # to one question: there may be several relays


class ZenohPublisher:
    """Maintains the link in its own thread. Every method except `stop` returns at once."""

    def __init__(
        self,
        robot: str,
        views: Sequence[str],
        relay: RelayRoute,
        *,
        snapshot: Callable[[str], Snapshot | None],
        heard: Callable[[str], None],
        credential: Proof | None = None,
    ) -> None:
        """`snapshot` and `heard` take a view and are called by Zenoh's threads; `heard` when a relay starts
        to listen. Lateness is measured on the first of `views`, which must be the fastest."""
        self.run = Run()
        self.connected = False
        self.echoes = 0  # questions answered or not: each a new measurement of lateness
        self.exceptions = ExceptionLog(log.warning)
        self._watch = EchoWatch(self.run.id)
        self._news = News()
        self._robot, self._relay, self._credential = robot, relay, credential
        self._tunnel = Tunnel(relay, log.warning) if relay.needs_tunnel else None
        self._warned = ""  # why there is no link
        self._patience: RefusalPatience | None = None  # made by the first diagnosis
        self._view_publishers = {
            view: ViewPublisher(
                robot, view, self.run, partial(snapshot, view), partial(heard, view), self.exceptions
            )
            for view in views
        }
        self._measured = views[0]
        self._rotation = ProofRotation(
            self._find_endpoint,
            credential,
            frame_key(robot, views[0]),
            lambda: self.connected,
            self._notify,
            self.exceptions,
        )
        self._model_server = ModelServer(robot, self.run, self.exceptions)
        self._wake = threading.Condition()  # two threads wait on it, so use notify_all
        self._stopping = False
        self._just_linked = False
        self._linked_s = 0.0
        self._watch_lock = threading.Lock()
        self._session: zenoh.Session | None = None
        self._declared: list[object] = []  # kept alive: Zenoh undeclares an entity when its object is dropped
        self._callback_threads = CallbackThreads()
        self._thread = threading.Thread(target=self._keep_link, name="link", daemon=True)
        self._echo_thread: threading.Thread | None = None
        self._echo_ends = False

    # --- for the agent

    def start(self) -> None:
        """Start connecting."""
        self._thread.start()
        self._rotation.start()

    def send_frame(self, view: str, frame: Frame) -> None:
        """Send a frame, or discard it when there is no link."""
        view_publisher = self._view_publishers[view]
        if not view_publisher.declared:
            return
        if view == self._measured:
            with self._watch_lock:
                self._watch.record_frame(frame.seq, time.monotonic())
        view_publisher.send_frame(frame.data, frame.taken_s)

    def queue_event(self, view: str, event: Event) -> None:
        """Send an event as soon as the relay listens."""
        with self._wake:
            self._view_publishers[view].events.append(event)
            self._wake.notify_all()

    def queue_info(self, view: str, texts: dict[str, str]) -> None:
        """Send the robot's texts, always all of them, as soon as the relay listens."""
        with self._wake:
            self._view_publishers[view].info = texts
            self._wake.notify_all()

    def set_model(self, bundle: Bundle) -> None:
        """Answer queries with this model from now on, and announce its hash as soon as the relay listens."""
        with self._wake:
            self._model_server.bundle = bundle
            for view_publisher in self._view_publishers.values():
                view_publisher.model = bundle.hash
            self._wake.notify_all()

    def stop(self, timeout_s: float) -> None:
        """Send what is waiting, then close. Gives up waiting for the link's thread after `timeout_s`
        seconds."""
        with self._wake:
            self._stopping = True
            self._wake.notify_all()
        self._model_server.close()
        self._rotation.stop()
        self._thread.join(timeout_s)
        if self._tunnel is not None:
            self._tunnel.close()

    def wait_for_end(self, timeout_s: float) -> None:
        """After `stop`: wait for threads that may still be in a Zenoh call, at most `timeout_s` seconds."""
        until_s = time.monotonic() + timeout_s
        for thread in filter(None, (self._thread, self._echo_thread, self._rotation.thread)):
            thread.join(max(0.0, until_s - time.monotonic()))
        self._callback_threads.join(until_s)

    @property
    def why_no_link(self) -> str:
        """Why there has been no link for a while, in one line; "" if unknown or if the link is up."""
        return self._warned

    @property
    def late_s(self) -> float:
        """How late frames arrive at the relay, in seconds, from the newest echo."""
        return self._watch.late_s

    @property
    def may_send(self) -> bool:
        """Whether frames should be sent: the link is up, the relay listens, and no queue has built up."""
        if not self.connected or self._watch.is_queue_full(time.monotonic()):
            return False
        return self._view_publishers[self._measured].has_listener

    def describe_state(self) -> str:
        """The state of the link in a word or two; see EchoWatch.describe_state."""
        return self._watch.describe_state(time.monotonic())

    @property
    def over(self) -> str:
        """Which limit of the relay the robot exceeds, so that some data is dropped; "" for none."""
        return self._watch.over

    def list_changes(self) -> list[str]:
        """Log lines for what the newest echo has changed."""
        now_s = time.monotonic()
        return self._news.list_changes(self._watch.describe_state(now_s), self._watch.over, now_s)

    # --- the link's thread

    def _keep_link(self) -> None:
        session: zenoh.Session | None = None
        while not self._stopping:
            session = session or self._open()
            if session is None:
                return
            newer: zenoh.Session | None = None
            try:
                with session:
                    newer = self._serve(session)
            except Exception as e:
                self.exceptions.add("the link", e)
            session = newer
            if session is None:
                self._drop_link()

    def _drop_link(self) -> None:
        """Forget a link that has ended, and wait before the next one."""
        self._session, self.connected = None, False
        for view_publisher in self._view_publishers.values():
            view_publisher.close()
        with self._watch_lock:
            self._watch.record_link(False)
        self._declared.clear()
        with self._wake:
            self._wake.wait_for(lambda: self._stopping, RETRY_MS[1] / 1000)

    def _serve(self, session: zenoh.Session) -> zenoh.Session | None:
        """Serve until the agent stops or a newer session takes over. Returns the newer one, with everything
        declared on it. Raises ZError when the session has ended on its own."""
        if self._session is not session:
            self._declare(session)
        self._echo_thread = threading.Thread(target=self._ask_echo, args=(session,), name="echo", daemon=True)
        self._echo_ends = False
        self._echo_thread.start()
        try:
            while self._send_waiting():
                newer = self._take_newer()
                if newer is not None:
                    self._declare(newer)  # before this one is closed, so that the relay misses nothing
                    return newer
                if session.is_closed():
                    raise zenoh.ZError("the session has ended")
            return None
        finally:  # a session must not be closed while another thread is calling it
            self._echo_ends = True
            self._notify()
            self._echo_thread.join(ECHO_END_S)

    def _take_newer(self) -> zenoh.Session | None:
        """The session that was opened with a new credential, if there is one."""
        found = self._rotation.take()
        if found is None:
            return None
        session, self._credential = found
        return session

    def _open(self) -> zenoh.Session | None:
        while not self._stopping:
            newer = self._take_newer()
            if newer is not None:
                return newer
            try:
                return zenoh.open(make_zenoh_config(self._find_endpoint(self._credential), self._credential))
            except zenoh.ZError:  # it always reports a timeout
                if not self._stopping:
                    self._diagnose()
            except Exception as e:
                self.exceptions.add("opening the link", e)
            with self._wake:
                self._wake.wait_for(lambda: self._stopping, RETRY_MS[0] / 1000)
        return None

    def _find_endpoint(self, proof: Proof | None) -> str:
        """Where Zenoh reaches the relay with this proof. Raises OSError when there is no place for a
        tunnel's socket."""
        return self._relay.endpoint if self._tunnel is None else self._tunnel.open(proof)

    def _diagnose(self) -> None:
        """Find out why there is no link, and log it once, and again when the reason changes."""
        from posecast_edge.uplink.diagnosis import Diagnosis, RefusalPatience, diagnose_link  # noqa: PLC0415 - few runs ever need it

        try:
            refusal = "" if self._tunnel is None else self._tunnel.refusal
            found = Diagnosis(refusal) if refusal else diagnose_link(self._relay, self._credential)
            self._patience = self._patience or RefusalPatience()
            if self._patience.is_sure(found, time.monotonic()):
                self._warn_once(found.why)
        except Exception as e:
            self.exceptions.add("finding out why there is no link", e)

    def _warn_once(self, why: str) -> None:
        if why != self._warned:
            self._warned = why
            log.warning("%s %s; still trying", self._relay, why)

    def _declare(self, session: zenoh.Session) -> None:
        """Declare everything that this agent offers. A relay that sees the token asks for the snapshot, then
        for the model, so these are declared in reverse order."""
        before, self._session, self._declared = self._declared, session, []
        on_transport = self.exceptions.guard("the link", partial(self._on_transport, session))
        on_model = self.exceptions.guard("a query about the model", self._model_server.enqueue_query)
        with self._callback_threads.collect():
            self._declared += [
                session.info.declare_transport_events_listener(on_transport, history=True),
                session.declare_queryable(model_key(self._robot, "**"), on_model),
            ]
            for view_publisher in self._view_publishers.values():
                self._declared += view_publisher.declare(session)
        self._declared.append(session.liveliness().declare_token(alive_key(self._robot)))
        if before:  # the relay reads a session in order: its answer says that it has read this token
            self._echo_of(session)
        del before  # dropping them undeclares them: only after the relay knows the newer ones

    def _notify(self) -> None:
        with self._wake:
            self._wake.notify_all()

    def _send_waiting(self) -> bool:
        """Send what is waiting, or wait for something. False when the agent stops and no more can be sent."""
        with self._wake:
            waiting = [
                view_publisher for view_publisher in self._view_publishers.values() if view_publisher.waiting
            ]
            ready = next((view_publisher for view_publisher in waiting if view_publisher.ready), None)
            if ready is None:
                if not self._stopping:
                    self._wake.wait(0.1 if waiting else LOOK_S)
                return not self._stopping
            item = ready.find_next()
        is_over = True
        try:
            ready.send(item)
        except Exception as e:
            is_over = not isinstance(e, zenoh.ZError)  # that is of the link: the item can go on the next one
            self.exceptions.add(f"sending events of {ready.view}", e)
        with self._wake:
            if is_over:
                ready.remove(item)
            else:
                ready.postpone()
        return True

    # --- called by Zenoh's threads

    def _on_transport(self, session: zenoh.Session, event: zenoh.TransportEvent) -> None:
        if session is not self._session:  # a newer one has taken over
            return
        self.connected = event.kind == zenoh.SampleKind.PUT
        with self._watch_lock:
            self._watch.record_link(self.connected)
        with self._wake:
            self._just_linked = self.connected  # measure the answer time before a queue can build up
            self._linked_s = time.monotonic()
            self._wake.notify_all()
        self._warned = ""
        self._patience = None
        if not self._stopping:
            log.info("%s %s", "linked to" if self.connected else "lost", self._relay)
        if not self.connected:
            self._rotation.hurry()  # the relay may accept other credentials now

    # --- the echo's thread

    @property
    def _is_ending(self) -> bool:
        return self._stopping or self._echo_ends

    def _ask_echo(self, session: zenoh.Session) -> None:
        while not self._is_ending and self._session is session:
            with self._wake:
                new = time.monotonic() - self._linked_s < NEW_LINK_S
                pause_s = ECHO_AGAIN_S if new or self._watch.late_s > LATE_S else ECHO_S
                self._wake.wait_for(lambda: self._is_ending or self._just_linked, pause_s)
                self._just_linked = False
            if self._is_ending:
                continue
            if not self.connected:
                if time.monotonic() - self._linked_s > WHY_S:
                    self._diagnose()
                continue
            asked_s = time.monotonic()
            with self._watch_lock:
                self._watch.record_question(asked_s)
            echo = self._echo_of(session)
            with self._watch_lock:
                # the time of a link that a newer one has replaced says nothing of that one
                if self.connected and self._session is session:
                    self._watch.record_answer(echo, asked_s, time.monotonic())
                    self.echoes += 1
            # a valid certificate opens the link even if it has a wrong name
            stranger = echo is None and isinstance(self._credential, Certificate)
            if stranger and self.connected and asked_s - self._linked_s > WHY_S:
                self._warn_once(f"does not know {self._robot!r}, or the certificate has another name")

    def _echo_of(self, session: zenoh.Session) -> Echo | None:
        """The newest valid answer of the relays. Invalid ones are counted."""
        echo: Echo | None = None
        try:
            replies = session.get(
                echo_key(self._robot),
                timeout=ECHO_TIMEOUT_S,
                priority=zenoh.Priority.REAL_TIME,
                congestion_control=zenoh.CongestionControl.DROP,
            )
            for reply in islice(replies, ECHO_REPLIES_MAX):
                if reply.ok is None:
                    continue
                if len(reply.ok.payload) > ECHO_BYTES_MAX:
                    raise ValueError(f"{len(reply.ok.payload)} bytes")
                echo = Echo.unpack(reply.ok.payload.to_bytes())
        except Exception as e:
            if self._session is session and not self._is_ending:
                self.exceptions.add("the relay's echo", e)
        return echo


# --- one view

EVENTS_MAX = 100  # waiting for the link; the oldest is dropped first. The relay keeps as many
INFO_EVERY_S = 0.5  # texts that change more often are sent together
SNAPSHOTS_S = 10.0  # answers a second: a relay asks once a second, and there may be several relays;
SNAPSHOTS_AT_ONCE = 20.0  # a burst may have this many
KEY_FIRST_S = 1.0  # how long events wait for the KEY that makes the relay switch to this run
RETRY_S = 0.1  # after a failed attempt to send, unless there is a new link before

Waiting = Event | dict[str, str] | str  # an event, info, or the hash of a model


class ViewPublisher:
    """Publishes the frames, events and the snapshot of one view: queues data until the relay listens, and
    decides the order of sending. ZenohPublisher's lock guards what is waiting."""

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


# --- the threads of Zenoh's callbacks

CALLBACK_THREAD = "pyo3-closure"  # Zenoh starts a thread of this name for each declared callback


class CallbackThreads:
    """The threads of callbacks that were declared within `collect`. Each ends soon after its session is
    closed. If the interpreter ends first, the thread's return into Python aborts the process."""

    def __init__(self) -> None:
        self._threads: list[threading.Thread] = []

    @contextmanager
    def collect(self) -> Iterator[None]:
        """Remember the threads of the callbacks that are declared in this block."""
        before = set(threading.enumerate())
        try:
            yield
        finally:
            new = [t for t in threading.enumerate() if t not in before and CALLBACK_THREAD in t.name]
            self._threads = [t for t in self._threads if t.is_alive()] + new

    def join(self, until_s: float) -> None:
        """Wait until all have ended, at most until `until_s` (monotonic seconds)."""
        for thread in self._threads:
            thread.join(max(0.0, until_s - time.monotonic()))
