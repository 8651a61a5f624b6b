"""Source `ros2`: a ROS 2 robot over Zenoh, without ROS installed (the extra [ros]).

    ros2                          the Zenoh router on this machine, port 7447
    ros2:HOST[:PORT][/NAMESPACE]  another router; only topics below the namespace. ros2://HOST… is the same

The robot runs rmw_zenoh (and its router), or DDS with zenoh-bridge-ros2dds. The agent opens a Zenoh session
to that router, separate from the uplink's. It only subscribes there and publishes nothing.
"""

from __future__ import annotations

import importlib.util
import json
import logging
import re
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import zenoh
from posecast_wire.command_line.installation import advise_extra
from zenoh.ext import HistoryConfig, declare_advanced_subscriber

from posecast_edge.kit import SAY_EVERY_S, RateLimitedLog
from posecast_edge.sample import SourceError
from posecast_edge.sources.base import Deliver, Source
from posecast_edge.sources.ros.input import RosInput, RosSource
from posecast_edge.sources.ros.messages import DESCRIPTION_MAX, PAYLOAD_MAX, STRING, TF, shorten_type

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile

log = logging.getLogger("posecast_edge.ros2")

PORT = 7447  # of rmw_zenoh's router
ADDRESS = re.compile(r"(?://)?(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+)?(?::(\d{1,5}))?((?:/[A-Za-z0-9_]+)*)/?")
OPEN_MS = 2000  # one attempt; between attempts the thread checks whether to stop
LEASE_MS = 2500
RETRY_MS = (200, 2000)
WAIT_S = 0.2
REST_S = 0.004  # between two reads; messages that arrive in between are handled together
BACKLOG_MAX = 4 << 20  # bytes of waiting messages; the oldest are dropped
WAITING = 512  # bytes of overhead of a waiting message
BRIDGED_MAX = 64  # topics of bridges


def open_source(address: str, profile: Profile | None) -> Source:
    """Open the source. Raises SourceError when the address is invalid or the extra is missing. If the robot
    is not reachable yet, the source waits for it."""
    match = ADDRESS.fullmatch(address)
    port = int(match[2] or PORT) if match else 0
    if match is None or not 0 < port < 65536:
        raise SourceError(
            f"ros2: {address!r} is not an address; use ros2, ros2:HOST or ros2://HOST:PORT/NAMESPACE"
        )
    if importlib.util.find_spec("rosbags") is None:
        raise SourceError(f"ros2: its decoder is not installed; {advise_extra('posecast-edge', 'ros')}")
    return Ros2Source(match[1] or "localhost", port, match[3], profile)


class Ros2Source(RosSource):
    """Turns messages of a ROS 2 graph into samples."""

    def __init__(self, host: str, port: int, namespace: str, profile: Profile | None) -> None:
        self.description = f"ros2 {host}:{port}{namespace}"
        self._endpoint = f"tcp/{host}:{port}"
        super().__init__(RosInput(f"{host}:{port}", profile, namespace))
        self._domain = profile.ros.domain if profile and profile.ros else None
        self._inbox = Inbox()
        self._bridged: deque[str] = deque(maxlen=BRIDGED_MAX)  # keys to subscribe to
        self._of_key: dict[str, Found] = {}  # keys of bridges
        self._bridged_frames: deque[Found] = deque(maxlen=BRIDGED_MAX)  # of /tf, which may be needed later
        self._dropped = RateLimitedLog(log.warning, "times", SAY_EVERY_S)

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver samples until `stop`."""
        from posecast_edge.sources.ros.cdr import CdrReader  # noqa: PLC0415 - imports NumPy, which is slow

        cdr = CdrReader()
        session = self._open(stop)
        if session is None:
            return
        with session:
            held = self._declare(session)
            while not stop.is_set():
                if self._intake.begin_reading_joints():
                    held += self._subscribe_frames(session)
                while self._bridged:
                    held.append(self._subscribe(session, self._bridged.popleft()))
                messages, lost = self._inbox.take(WAIT_S)
                for topic, type_name, payload in messages:
                    self._intake.take_message(topic, type_name, partial(cdr.read, type_name, payload))
                now_s = time.monotonic()
                if lost:
                    self._dropped.add(f"{lost} messages came too fast; the oldest were dropped", now_s)
                self._dropped.tick(now_s)
                sample = self._intake.make_sample()
                if sample is not None:
                    deliver(sample)
                stop.wait(REST_S)

    # --- the session

    def _open(self, stop: threading.Event) -> zenoh.Session | None:
        is_reported = False
        while not stop.is_set():
            with suppress(zenoh.ZError):  # it always reports a timeout
                return zenoh.open(_config(self._endpoint))
            if not is_reported:
                is_reported = True
                log.warning("%s does not answer; still trying", self._endpoint)
            stop.wait(RETRY_MS[0] / 1e3)
        return None

    def _declare(self, session: zenoh.Session) -> list[object]:
        """Declare everything. The caller must keep the returned objects alive."""
        held: list[object] = [
            session.info.declare_transport_events_listener(self._on_transport, history=True),
            *(
                session.liveliness().declare_subscriber(key, self._on_token, history=True)
                for key in (make_token_key(self._domain), BRIDGE_TOKENS)
            ),
        ]
        for pattern, type_name in self._intake.routes.list_patterns():
            key = make_data_key(pattern, type_name, self._domain)
            held.append(self._subscribe(session, key, latched=is_latched(pattern, type_name)))
        return held

    def _subscribe_frames(self, session: zenoh.Session) -> list[object]:
        """Subscribe to all topics of transforms, because no other topic reports the joints."""
        for found in self._bridged_frames.copy():
            self._bridge(found)
        return [
            self._subscribe(session, make_data_key(pattern, TF, self._domain), is_latched(pattern, TF))
            for pattern in self._intake.routes.list_frame_patterns()
        ]

    def _subscribe(self, session: zenoh.Session, key: str, latched: bool | None = None) -> object:
        """Subscribe. `latched`: also receive earlier messages (transient local)."""
        if latched is None:
            latched = is_latched(self._of_key[key].topic, self._of_key[key].type_name)
        if not latched:
            return session.declare_subscriber(key, self._on_data)
        history = HistoryConfig(detect_late_publishers=True, max_samples=1)
        return declare_advanced_subscriber(session, key, self._on_data, history=history)

    # --- called by Zenoh's threads

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        linked = event.kind == zenoh.SampleKind.PUT
        log.info("%s %s", "robot's router linked:" if linked else "robot's router lost:", self._endpoint)

    def _on_token(self, sample: zenoh.Sample) -> None:
        found = match_token_key(str(sample.key_expr)) if sample.kind == zenoh.SampleKind.PUT else None
        if found is None:
            return
        route = self._intake.add_topic(found.topic, found.type_name)
        if found.key and found.type_name == TF and not route:
            self._bridged_frames.append(found)
        if route:
            self._bridge(found)

    def _bridge(self, found: Found) -> None:
        """Queue a subscription to a bridge's topic."""
        key = found.key
        if key and key not in self._of_key and len(self._of_key) < BRIDGED_MAX:
            self._of_key[key] = found
            self._bridged.append(key)

    def _on_data(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        found = self._of_key.get(key) or match_data_key(key)
        if found is None or sample.kind != zenoh.SampleKind.PUT:
            return
        size = len(sample.payload)
        if size > (DESCRIPTION_MAX if found.type_name == STRING else PAYLOAD_MAX):
            self._intake.report_bad(found.topic, f"a message of {size} bytes is too large")
            return
        self._inbox.put(found.topic, found.type_name, sample.payload.to_bytes())


def is_latched(topic: str, type_name: str) -> bool:
    """Whether earlier messages count, too (transient local)."""
    return type_name == STRING or (type_name == TF and topic.endswith("tf_static"))


class Inbox:
    """Passes payloads from Zenoh's threads to the source's. Holds at most BACKLOG_MAX bytes, then drops the
    oldest."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[str, str, bytes]] = deque()
        self._bytes = 0
        self._lost = 0
        self._some = threading.Condition()

    def put(self, topic: str, type_name: str, payload: bytes) -> None:
        """Add one payload. May be called from any thread."""
        with self._some:
            self._waiting.append((topic, type_name, payload))
            self._bytes += len(payload) + WAITING
            while self._bytes > BACKLOG_MAX and len(self._waiting) > 1:
                self._bytes -= len(self._waiting.popleft()[2]) + WAITING
                self._lost += 1
            self._some.notify()

    def take(self, wait_s: float) -> tuple[list[tuple[str, str, bytes]], int]:
        """Wait up to `wait_s` seconds; return all waiting (topic, type, payload) and how many were dropped
        since the last call."""
        with self._some:
            if not self._waiting:
                self._some.wait(wait_s)
            taken, lost = list(self._waiting), self._lost
            self._waiting.clear()
            self._bytes = self._lost = 0
        return taken, lost


def _config(endpoint: str) -> zenoh.Config:
    """A client of one router that discovers nobody else."""
    retry = {"period_init_ms": RETRY_MS[0], "period_max_ms": RETRY_MS[1], "period_increase_factor": 2}
    document: dict[str, Any] = {
        "mode": "client",
        "connect": {"endpoints": [endpoint], "timeout_ms": OPEN_MS, "retry": retry},
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {
            "link": {"tx": {"lease": LEASE_MS, "keep_alive": 4}},
            "shared_memory": {"enabled": False},
        },
    }
    return zenoh.Config.from_json5(json.dumps(document))


# --- ROS 2 names in Zenoh's keys, as rmw_zenoh and zenoh-bridge-ros2dds write them
#
# rmw_zenoh  data   DOMAIN/TOPIC/TYPE/HASH                TYPE: sensor_msgs::msg::dds_::JointState_
#            token  @ros2_lv/DOMAIN/ZID/NODE/ID/MP/ENCLAVE/NAMESPACE/NODE NAME/TOPIC/TYPE/HASH/QOS, % for /
# bridge     data   TOPIC                                 no type: the token has it
#            token  @/ZID/@ros2_lv/MP/TOPIC/TYPE/QOS, § for /; TYPE: sensor_msgs/msg/JointState

ANY_DOMAIN = "*"
BRIDGE_TOKENS = "@/*/@ros2_lv/MP/**"


@dataclass(frozen=True)
class Found:
    """A topic with a publisher. `type_name`: short form. `key`: where a bridge publishes its data; None for
    rmw_zenoh, whose key follows from topic and type."""

    topic: str
    type_name: str
    key: str | None = None


def make_dds_type(type_name: str) -> str:
    """Convert `sensor_msgs/JointState` to `sensor_msgs::msg::dds_::JointState_`."""
    package, _, name = type_name.partition("/")
    return f"{package}::msg::dds_::{name}_"


def make_data_key(pattern: str, type_name: str, domain: int | None) -> str:
    """The key expression of rmw_zenoh's data for all topics that match `pattern` (see topics.match_topic)."""
    parts = [p if p in ("*", "**") else p.replace("*", "$*") for p in pattern.strip("/").split("/")]
    where = ANY_DOMAIN if domain is None else domain
    return f"{where}/{'/'.join(parts)}/{make_dds_type(type_name)}/*"


def make_token_key(domain: int | None) -> str:
    """The key expression of the liveliness tokens of rmw_zenoh's publishers."""
    return f"@ros2_lv/{ANY_DOMAIN if domain is None else domain}/*/*/*/MP/**"


def match_data_key(key: str) -> Found | None:
    """The topic and type in a data key of rmw_zenoh; None for any other key."""
    parts = key.split("/")
    if len(parts) < 4 or not parts[0].isdigit() or "::" not in parts[-2]:
        return None
    return Found("/" + "/".join(parts[1:-2]), shorten_type(parts[-2]))


def match_token_key(key: str) -> Found | None:
    """The topic and type in a publisher's liveliness token; None for any other key."""
    parts = key.split("/")
    if parts[0] == "@ros2_lv" and len(parts) == 13 and parts[5] == "MP":
        return Found(_slashes(parts[9], "%"), shorten_type(parts[10]))
    if parts[0] == "@" and len(parts) == 7 and parts[2:4] == ["@ros2_lv", "MP"]:
        topic = _slashes(parts[4], "§")
        return Found(topic, shorten_type(parts[5].replace("§", "/")), topic.lstrip("/"))
    return None


def _slashes(name: str, stand_in: str) -> str:
    return "/" + name.replace(stand_in, "/").lstrip("/")
