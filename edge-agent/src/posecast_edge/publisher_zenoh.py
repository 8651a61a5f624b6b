"""The one outbound link. It publishes frames and events and answers questions about its own state; it
subscribes to nothing, so nothing can flow towards the robot.

Zenoh reconnects by itself and for ever once a session is open; frames put meanwhile are discarded by it, so
there is no backlog when the link comes back.
"""

from __future__ import annotations

import json
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import cast

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

from posecast_edge.echo import EchoWatch
from posecast_edge.events import Event
from posecast_edge.model.bundle import RANGE_MAX, Bundle
from posecast_edge.run import Run

log = logging.getLogger("posecast_edge.link")

OPEN_MS = 2000  # one attempt; in between the thread looks whether it is to stop
LEASE_MS = 2500  # the relay takes an edge for gone after this long without a sign of life
RETRY_MS = (200, 1000)
BATCH_BYTES = 8192  # small batches and a small kernel buffer: on a thin uplink a queue is only delay
SNDBUF_BYTES = 32768
ECHO_S = 1.0
ECHO_TIMEOUT_S = 2.0
EVENTS_MAX = 100  # waiting for the link; the oldest goes first. The relay keeps as many
KEY_FIRST_S = 1.0  # events wait this long for the KEY that makes the relay adopt this run


def zenoh_config(relay: str) -> zenoh.Config:
    """A client of one relay that finds nobody else. `relay`: a Zenoh endpoint, `tcp/host:port`."""
    endpoint = relay if relay.startswith("quic/") else f"{relay}#so_sndbuf={SNDBUF_BYTES}"
    retry = {"period_init_ms": RETRY_MS[0], "period_max_ms": RETRY_MS[1], "period_increase_factor": 2}
    return zenoh.Config.from_json5(
        json.dumps(
            {
                "mode": "client",
                "connect": {"endpoints": [endpoint], "timeout_ms": OPEN_MS, "retry": retry},
                "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
                "transport": {
                    "link": {"tx": {"lease": LEASE_MS, "keep_alive": 4, "batch_size": BATCH_BYTES}},
                    "shared_memory": {"enabled": False},
                },
            }
        )
    )


def _matching(publisher: zenoh.Publisher) -> zenoh.MatchingStatus:
    return cast(zenoh.MatchingStatus, publisher.matching_status)  # zenoh's stub says bool; it is not


def _event_document(event: Event) -> dict[str, object]:
    return {
        "type": "event",
        "t": event.t_s,
        "level": event.level,
        "source": event.source,
        "text": event.text,
        "state": "on" if event.on else "off",
    }


class ZenohPublisher:
    """Keeps the link in a thread of its own. Every method returns at once."""

    def __init__(
        self,
        robot: str,
        view: str,
        relay: str,
        *,
        snapshot: Callable[[], Snapshot | None],
        heard: Callable[[], None],
        bundle: Bundle | None = None,
    ) -> None:
        """`snapshot` and `heard` are called by Zenoh's threads; `heard` when somebody begins to listen."""
        self.run = Run()
        self.connected = False
        self.echoes = 0  # questions answered or not: each a new measurement of lateness
        self._watch = EchoWatch(self.run.id)
        self._robot, self._view, self._relay = robot, view, relay
        self._snapshot, self._heard, self._bundle = snapshot, heard, bundle
        self._frames: zenoh.Publisher | None = None
        self._events: deque[Event] = deque(maxlen=EVENTS_MAX)
        self._info: dict[str, str] | None = None  # waits for the link; the newest only
        self._wake = threading.Condition()  # two threads wait on it, hence notify_all
        self._stopping = False
        self._heard_s = 0.0
        self._frame_since_heard = False
        self._watch_lock = threading.Lock()
        self._declared: list[object] = []  # Zenoh undeclares what nobody holds
        self._thread = threading.Thread(target=self._keep_link, name="link", daemon=True)

    # --- for the agent

    def start(self) -> None:
        """Begin to connect."""
        self._thread.start()

    def frame(self, data: bytes, seq: int) -> None:
        """Send a frame, or discard it when there is no link."""
        publisher = self._frames
        if publisher is None:
            return
        with self._watch_lock:
            self._watch.sent(seq, time.monotonic())
        publisher.put(data, attachment=self.run.stamp().pack())
        self._frame_since_heard = True

    def event(self, event: Event) -> None:
        """Send an event as soon as somebody listens."""
        with self._wake:
            self._events.append(event)
            self._wake.notify_all()

    def info(self, texts: dict[str, str]) -> None:
        """Send what the robot says of itself, all of it, as soon as somebody listens."""
        with self._wake:
            self._info = texts
            self._wake.notify_all()

    def stop(self, timeout_s: float) -> bool:
        """Send what waits, close. False when the link's thread did not end in time ."""
        with self._wake:
            self._stopping = True
            self._wake.notify_all()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    @property
    def late_s(self) -> float:
        """How late frames arrive, s, by the newest echo."""
        return self._watch.late_s

    def word(self) -> str:
        """The state of the link in a word or two."""
        return self._watch.word(time.monotonic())

    # --- the link's thread

    def _keep_link(self) -> None:
        session = self._open()
        if session is None:
            return
        with session:
            events = self._declare(session)
            threading.Thread(target=self._ask_echo, args=(session,), name="echo", daemon=True).start()
            while self._send_waiting(events):
                pass
            self._frames = None

    def _open(self) -> zenoh.Session | None:
        told = False
        while not self._stopping:
            with suppress(zenoh.ZError):  # which only ever says that time ran out
                return zenoh.open(zenoh_config(self._relay))
            if not told:
                told = True
                log.warning("%s does not answer, trying on", self._relay)
            with self._wake:
                self._wake.wait_for(lambda: self._stopping, RETRY_MS[0] / 1000)
        return None

    def _declare(self, session: zenoh.Session) -> zenoh.Publisher:
        """All that this agent is on the network. Who sees the token asks for the snapshot, and who has that
        for the model: so they are declared the other way round."""
        robot, view = self._robot, self._view
        frames = session.declare_publisher(
            frame_key(robot, view),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME,
        )
        events = session.declare_publisher(
            event_key(robot, view),
            reliability=zenoh.Reliability.RELIABLE,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )
        self._frames = frames
        self._declared += [
            session.info.declare_transport_events_listener(self._on_transport, history=True),
            frames.declare_matching_listener(self._on_matching),
            session.declare_queryable(model_key(robot, "**"), self._on_model),
            session.declare_queryable(snapshot_key(robot, view), self._on_snapshot),
            session.liveliness().declare_token(alive_key(robot)),
        ]
        self._on_matching(_matching(frames))  # it may have matched before anybody listened for it
        return events

    def _send_waiting(self, publisher: zenoh.Publisher) -> bool:
        """Send the info or an event, or wait for one. False when the agent stops and no more can be sent."""
        with self._wake:
            waiting = bool(self._events) or self._info is not None
            if not (waiting and _matching(publisher).matching and self._key_went_first()):
                if not self._stopping:
                    self._wake.wait(0.1 if waiting else None)
                return not self._stopping
            if self._info is not None:
                document: dict[str, object] = {"type": "info", "kv": self._info}
                self._info = None
            else:
                document = _event_document(self._events.popleft())
        text = json.dumps(document, ensure_ascii=False, separators=(",", ":"))
        publisher.put(text.encode(), attachment=self.run.stamp().pack())
        return True

    def _key_went_first(self) -> bool:
        return self._frame_since_heard or time.monotonic() - self._heard_s > KEY_FIRST_S

    # --- called by Zenoh's threads

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        self.connected = event.kind == zenoh.SampleKind.PUT
        with self._watch_lock:
            self._watch.link(self.connected)
        if not self._stopping:
            log.info("%s %s", "linked to" if self.connected else "lost", self._relay)

    def _on_matching(self, status: zenoh.MatchingStatus) -> None:
        if status.matching:
            self._heard_s, self._frame_since_heard = time.monotonic(), False
            self._heard()

    def _on_snapshot(self, query: zenoh.Query) -> None:
        with query:
            snapshot = self._snapshot()
            if snapshot is None:
                query.reply_err(b"no sample yet")
                return
            stamp = self.run.stamp().pack()
            query.reply(snapshot_key(self._robot, self._view), snapshot.pack(), attachment=stamp)

    def _on_model(self, query: zenoh.Query) -> None:
        part = str(query.key_expr).rpartition("/")[2]
        with query:
            try:
                data = self._model_range(part, query.parameters)
            except (KeyError, ValueError, OSError) as e:
                query.reply_err(f"{part[:64]}: {e}".encode())
                return
            query.reply(model_key(self._robot, part), data, attachment=self.run.stamp().pack())

    def _model_range(self, part: str, parameters: zenoh.Parameters) -> bytes:
        """KeyError, ValueError, OSError: there is no such file or range."""
        if self._bundle is None:
            raise KeyError("no model")
        offset = int(parameters.get("off") or 0)
        length = int(parameters.get("len") or RANGE_MAX)
        return self._bundle.read(part, offset, length)

    # --- the echo's thread

    def _ask_echo(self, session: zenoh.Session) -> None:
        while not self._stopping:
            with self._wake:
                self._wake.wait_for(lambda: self._stopping, ECHO_S)
            if self._stopping or not self.connected:
                continue
            asked_s = time.monotonic()
            echo = self._echo_of(session)
            with self._watch_lock:
                if self.connected:
                    self._watch.answered(echo, asked_s, time.monotonic())
                    self.echoes += 1

    def _echo_of(self, session: zenoh.Session) -> Echo | None:
        echo: Echo | None = None
        try:
            replies = session.get(
                echo_key(self._robot),
                timeout=ECHO_TIMEOUT_S,
                priority=zenoh.Priority.REAL_TIME,
                congestion_control=zenoh.CongestionControl.DROP,
            )
            for reply in replies:
                if reply.ok is not None:
                    echo = Echo.unpack(reply.ok.payload.to_bytes())
        except (zenoh.ZError, ValueError) as e:
            log.debug("echo: %s", e)
        return echo
