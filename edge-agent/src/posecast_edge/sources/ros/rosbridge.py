"""Source `rosbridge`: a ROS 1 or ROS 2 robot through its rosbridge_server (the extra [ros]).

    rosbridge:HOST[:PORT][/PATH]   port 9090; rosbridge://HOST… is the same
    rosbridge:wss://HOST…          over TLS

rosapi, which is started with the server, lists the topics. Without it, the agent subscribes to the topics
that the profile names, and to /joint_states and /robot_description. Nothing is published.
"""

from __future__ import annotations

import importlib.util
import logging
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from posecast_wire.command_line.installation import advise_extra

from posecast_edge.kit import SAY_EVERY_S, Backoff, RateLimitedLog
from posecast_edge.sample import SourceError
from posecast_edge.sources.base import Deliver, Source
from posecast_edge.sources.ros.input import RosInput, RosSource
from posecast_edge.sources.ros.messages import CONTROLLER_STATE, RosMessageError, shorten_type
from posecast_edge.sources.ros.rosbridge_protocol import (
    MESSAGE_MAX,
    Answer,
    MessageAssembler,
    Publish,
    RosbridgeProtocolError,
    make_service_call,
    make_subscribe,
    parse_json,
)
from posecast_edge.sources.ros.topics import TYPES_OF_ROLE, Route

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

    from posecast_edge.profile.types import Profile

log = logging.getLogger("posecast_edge.rosbridge")

# The library only logs ended connections, which are logged here.
SILENT = logging.getLogger("posecast_edge.rosbridge.websockets")
SILENT.setLevel(logging.CRITICAL + 1)

PORT = 9090
ADDRESS = re.compile(
    r"(?:(ws|wss)://|//)?(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+)(?::(\d{1,5}))?((?:/[A-Za-z0-9_.~%-]*)*)"
)
OPEN_S = 3.0
PING_S = 3.0  # between pings; an unanswered one ends the connection after the same time
WAIT_S = 0.2
DRAIN_S = 0.05  # how long to receive before parsing
BATCH_MAX = 256  # messages; the newest are kept
BATCH_CHARS_MAX = 32 << 20  # characters or bytes of these
QUEUE_MAX = 8  # received frames that wait; beyond them the server has to wait
LOOK_S = (1.0, 10.0)  # between two requests for the list of topics; the longer one if none was answered yet
LOOK_SHARE = 0.05  # of a server's time: one that answers slowly is asked less often
ANSWER_S = 3.0  # without an answer by then, there is no rosapi
THROTTLE_MS = 15  # twice the rate that the fastest stream needs


def open_source(address: str, profile: Profile | None) -> Source:
    """Open the source. Raises SourceError when the address is invalid or the extra is missing. If the robot
    is not reachable yet, the source waits for it."""
    match = ADDRESS.fullmatch(address)
    port = int(match[3] or PORT) if match else 0
    if match is None or not 0 < port < 65536:
        raise SourceError(
            f"rosbridge: {address!r} is not an address; use rosbridge:HOST or rosbridge:wss://HOST:PORT"
        )
    if any(importlib.util.find_spec(name) is None for name in ("websockets", "cbor2")):
        raise SourceError(
            f"rosbridge needs a WebSocket client and CBOR: {advise_extra('posecast-edge', 'ros')}"
        )
    if match[1] == "wss" and not match[3]:
        port = 443
    return RosbridgeSource(f"{match[1] or 'ws'}://{match[2]}:{port}{match[4]}", profile)


class RosbridgeSource(RosSource):
    """Turns messages of a rosbridge server into samples."""

    def __init__(self, url: str, profile: Profile | None) -> None:
        self.description = f"rosbridge {url}"
        self._url = url
        super().__init__(RosInput(url, profile))
        self._encoding = profile.ros.encoding if profile and profile.ros else "json"
        self._wants_urdf = False
        self._backoff = Backoff()
        self._trouble = RateLimitedLog(log.warning, f"failures of {url}", SAY_EVERY_S)
        self._words = RateLimitedLog(log.warning, "messages of the server", SAY_EVERY_S)

    def send_urdf_to(self, take: Callable[[str], None]) -> None:
        """Pass every new robot_description (URDF text) to `take`, in the source's thread."""
        super().send_urdf_to(take)
        self._wants_urdf = True

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver samples until `stop`. When the connection ends, connect again and repeat all
        subscriptions."""
        from websockets.exceptions import WebSocketException  # noqa: PLC0415 - an extra
        from websockets.sync.client import connect  # noqa: PLC0415

        while not stop.is_set():
            now_s = time.monotonic()
            self._trouble.tick(now_s)
            if not self._backoff.is_due(now_s):
                stop.wait(WAIT_S / 4)
                continue
            try:
                with connect(
                    self._url,
                    open_timeout=OPEN_S,
                    close_timeout=WAIT_S,
                    ping_interval=PING_S,
                    ping_timeout=PING_S,
                    max_size=MESSAGE_MAX,
                    max_queue=QUEUE_MAX,
                    proxy=None,
                    logger=SILENT,
                ) as connection:
                    self._backoff.record_success(time.monotonic())
                    log.info("robot's rosbridge linked: %s", self._url)
                    self._talk(connection).run(deliver, stop)
            except (OSError, WebSocketException) as e:
                now_s = time.monotonic()
                self._backoff.record_failure(now_s)
                if not stop.is_set():
                    self._trouble.add(f"{self._url}: {_reason(e)}; still trying", now_s)

    def _talk(self, connection: ClientConnection) -> RosbridgeConnection:
        return RosbridgeConnection(connection, self._intake, self._encoding, self._wants_urdf, self._words)


class RosbridgeConnection:
    """One connection: asks for the list of topics, subscribes to the useful ones, and receives messages."""

    def __init__(
        self,
        connection: ClientConnection,
        intake: RosInput,
        encoding: str,
        wants_urdf: bool,
        words: RateLimitedLog,
    ) -> None:
        self._connection = connection
        self._intake = intake
        self._encoding = encoding
        self._wants_urdf = wants_urdf
        self._words = words
        self._ear = MessageAssembler()
        self._types: dict[str, str] = {}  # of topics, as the server spells them
        self._counting: dict[str, float] = {}  # topic whose publishers are being counted → since when
        self._subscribed: set[str] = set()
        self._throttled: set[str] = set()  # of these; they had one publisher
        self._looked_s = float("-inf")
        self._look_every_s = LOOK_S[1]
        self._listed: bool | None = None  # whether rosapi answers; None: unknown yet

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Exchange messages until `stop`. Raises OSError or WebSocketException when the connection ends."""
        while not stop.is_set():
            self._chores(time.monotonic())
            for data in self._newest():
                self._receive(data)
            sample = self._intake.make_sample()
            if sample is not None:
                deliver(sample)

    def _newest(self) -> deque[str | bytes]:
        """The received messages. If they arrive faster than they can be parsed, the newest BATCH_MAX."""
        taken: deque[str | bytes] = deque()
        chars = 0
        until_s = time.monotonic() + DRAIN_S
        try:
            taken.append(self._connection.recv(WAIT_S))
            chars += len(taken[-1])
            while time.monotonic() < until_s:
                taken.append(self._connection.recv(0))
                chars += len(taken[-1])
                while len(taken) > BATCH_MAX or (chars > BATCH_CHARS_MAX and len(taken) > 1):
                    chars -= len(taken.popleft())
        except TimeoutError:
            pass
        return taken

    def _chores(self, now_s: float) -> None:
        self._words.tick(now_s)
        if self._listed is None and self._looked_s + ANSWER_S < now_s < self._looked_s + LOOK_S[1]:
            self._listed = False
            log.warning("no answer from rosapi: subscribing to topics by name")
            self._subscribe_named()
        if now_s >= self._looked_s + self._look_every_s:
            if self._listed is False:
                self._intake.begin_reading_joints()
                self._subscribe_named()
            self._looked_s = now_s
            self._connection.send(make_service_call("/rosapi/topics", "topics"))
        for topic, since_s in list(self._counting.items()):
            if now_s - since_s > ANSWER_S:
                self._take_count(topic, 0)

    def _receive(self, data: str | bytes) -> None:
        try:
            heard = self._ear.feed(data)
            if isinstance(heard, Publish):
                type_name = self._type_of(heard)
                if type_name:
                    self._intake.take_message(heard.topic, type_name, lambda: heard.message)
            elif isinstance(heard, Answer):
                self._answer(heard)
            elif heard is not None and heard.level in ("error", "warning"):
                self._words.add(f"rosbridge says: {heard.text[:200]}", time.monotonic())
        except (RosbridgeProtocolError, RosMessageError) as e:
            self._intake.report_bad("rosbridge", str(e))

    def _type_of(self, heard: Publish) -> str:
        if heard.topic in self._types:
            return shorten_type(self._types[heard.topic])
        route = dict(self._intake.routes.list_topics()).get(heard.topic)
        if route is None:
            return ""
        of_controller = isinstance(heard.message, dict) and "joint_names" in heard.message
        return CONTROLLER_STATE if of_controller else TYPES_OF_ROLE[route.role][0]

    # --- topics

    def _answer(self, answer: Answer) -> None:
        what, _, topic = answer.id.partition(" ")
        values = answer.values
        if what == "topics":
            self._topics(values)
        elif what == "publishers" and topic in self._counting:
            publishers = (values or {}).get("publishers")
            self._take_count(topic, len(publishers) if isinstance(publishers, list) else 0)
        elif what == "description" and values is not None:
            self._parameter(values.get("value"))

    def _topics(self, values: dict[str, Any] | None) -> None:
        names, types = ((values or {}).get(key) for key in ("topics", "types"))
        if not isinstance(names, list) or not isinstance(types, list) or len(names) != len(types):
            if self._listed is None:
                self._listed = False
                log.warning("rosapi does not list its topics: subscribing to topics by name")
                self._subscribe_named()
            return
        first = self._listed is None
        self._listed = True
        took_s = time.monotonic() - self._looked_s
        self._look_every_s = min(max(took_s / LOOK_SHARE, LOOK_S[0]), LOOK_S[1])
        for topic, type_name in zip(names, types, strict=True):
            if isinstance(topic, str) and isinstance(type_name, str):
                self._intake.add_topic(topic, shorten_type(type_name))
        self._intake.begin_reading_joints(listed=True)
        for topic, type_name in zip(names, types, strict=True):
            if isinstance(topic, str) and isinstance(type_name, str):
                route = self._intake.add_topic(topic, shorten_type(type_name))
                if route and topic not in self._subscribed and topic not in self._counting:
                    self._types[topic] = type_name
                    self._want(topic, route)
                elif topic in self._throttled and topic not in self._counting:
                    self._count_publishers(topic)  # another one may have joined
        ros_1 = any(isinstance(t, str) and t.count("/") == 1 for t in types)
        if first and ros_1 and self._wants_urdf:  # in ROS 1 it is a parameter, not a topic
            question = make_service_call(
                "/rosapi/get_param", "description", name="/robot_description", default='""'
            )
            self._connection.send(question)

    def _want(self, topic: str, route: Route) -> None:
        """Subscribe. Streams are throttled, except topics with several publishers: there, the newest message
        of one publisher would replace that of another before it is sent."""
        if route.role in ("battery", "diagnostics", "description", "tf"):
            self._subscribe(topic, 0, described=route.role == "description")
            return
        self._count_publishers(topic)

    def _count_publishers(self, topic: str) -> None:
        self._counting[topic] = time.monotonic()
        self._connection.send(make_service_call("/rosapi/publishers", f"publishers {topic}", topic=topic))

    def _take_count(self, topic: str, count: int) -> None:
        """Take the number of publishers, 0 if the server does not say."""
        self._counting.pop(topic, None)
        if count == 1 and topic not in self._subscribed:
            self._throttled.add(topic)
            self._subscribe(topic, THROTTLE_MS)
        elif count > 1 or topic not in self._subscribed:
            self._throttled.discard(topic)
            self._subscribe(topic, 0)

    def _subscribe(self, topic: str, throttle_ms: int, described: bool = False) -> None:
        self._subscribed.add(topic)
        encoding = "json" if described else self._encoding  # a description is longer than CBOR may be
        self._connection.send(make_subscribe(topic, self._types.get(topic), encoding, throttle_ms))

    def _subscribe_named(self) -> None:
        """Subscribe, repeatedly: the server forgets subscriptions to a topic without a publisher."""
        for topic, route in self._intake.routes.list_topics():
            self._subscribe(topic, 0, described=route.role == "description")

    def _parameter(self, value: object) -> None:
        """Take a ROS 1 parameter, which rosapi returns as JSON. Raises ProtocolError or MessageError."""
        text = parse_json(value) if isinstance(value, str) else None
        if isinstance(text, str):
            self._intake.take_urdf(text)


def _reason(e: Exception) -> str:
    """Why the connection failed or ended."""
    from websockets.exceptions import ConnectionClosed  # noqa: PLC0415 - an extra

    if not isinstance(e, ConnectionClosed):
        return str(e) or type(e).__name__
    if e.rcvd is not None and (e.rcvd_then_sent or e.sent is None):
        return f"the server closed the connection: {e.rcvd}"
    if e.sent is not None and "ping timeout" in e.sent.reason:
        return "the server no longer answers"
    return f"the connection ended: {e.sent}" if e.sent is not None else "the connection was lost"
