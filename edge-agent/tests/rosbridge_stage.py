"""rosbridge_server as its protocol's specification has it, in Python: topics, rosapi, throttle and queue,
fragments, CBOR. What real servers do wrong can be asked for.
"""

from __future__ import annotations

import json
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import cbor2
from posecast_testing import free_port
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import Server, ServerConnection, serve

FLOATS = ("position", "velocity", "effort", "positions", "velocities", "orientation_covariance")


def packed(value: Any, name: str = "") -> Any:
    """As rosbridge's CBOR has it: arrays of float64 are typed arrays."""
    if isinstance(value, Mapping):
        return {k: packed(v, k) for k, v in value.items()}
    if isinstance(value, list):
        if name in FLOATS:
            return cbor2.CBORTag(86, struct.pack(f"<{len(value)}d", *value))
        return [packed(v) for v in value]
    return value


def fragments(text: str, size: int, name: object = "f1") -> list[str]:
    """A message in parts of that many characters."""
    parts = [text[i : i + size] for i in range(0, len(text), size)]
    return [
        json.dumps({"op": "fragment", "id": name, "data": part, "num": i, "total": len(parts)})
        for i, part in enumerate(parts)
    ]


@dataclass
class Subscription:
    """One client's wish, and when it was last served."""

    connection: ServerConnection
    wish: dict[str, Any]
    queue: deque[Any] = field(default_factory=deque)
    sent_s: float = float("-inf")


class Rosbridge:
    """Listens on loopback. `topics`: name → type, as rosapi tells them."""

    def __init__(self, topics: Mapping[str, str], port: int = 0, rosapi: bool = True) -> None:
        self.topics = dict(topics)
        self.publishers: dict[str, int] = {}  # of a topic, 1 unless said otherwise
        self.parameters: dict[str, str] = {}
        self.rosapi = rosapi
        self.fragment: int | None = None  # size of the pieces of every message
        self.latched: dict[str, Any] = {}
        self.asked: list[dict[str, Any]] = []  # all that clients ever said
        self.sent = 0
        self._subscriptions: list[Subscription] = []
        self._lock = threading.Lock()
        self._connections: set[ServerConnection] = set()
        self.port = port or free_port()
        self._server: Server = serve(self._talk, "127.0.0.1", self.port, compression=None)
        self._ended = threading.Event()
        for target in (self._server.serve_forever, self._serve_queues):
            threading.Thread(target=target, daemon=True).start()

    @property
    def source(self) -> str:
        return f"rosbridge:127.0.0.1:{self.port}"

    def stop(self) -> None:
        """As a process that dies: every connection is cut."""
        self._ended.set()
        self._server.socket.close()
        for connection in list(self._connections):
            with suppress(OSError):
                connection.socket.shutdown(2)
        self._server.shutdown()

    def publish(self, topic: str, message: Any) -> None:
        """A node publishes: to each subscriber now, later or never, as it has asked for."""
        with self._lock:
            for s in self._subscriptions:
                if s.wish["topic"] == topic:
                    self._offer(s, message)

    def say(self, data: str | bytes | Iterable[str]) -> None:
        """Anything at all, to everybody."""
        for connection in list(self._connections):
            with suppress(ConnectionClosed):
                connection.send(data)

    def part(self, code: int, reason: str) -> None:
        """Take leave of everybody."""
        for connection in list(self._connections):
            connection.close(code, reason)

    @property
    def connected(self) -> int:
        return len(self._connections)

    @property
    def subscribed(self) -> set[str]:
        return {s.wish["topic"] for s in self._subscriptions}

    # --- subscription_modifiers.py of rosbridge_library

    def _offer(self, s: Subscription, message: Any) -> None:
        throttle_s = s.wish.get("throttle_rate", 0) / 1e3
        length = s.wish.get("queue_length", 0)
        if length > 0:
            s.queue.append(message)
            while len(s.queue) > length:
                s.queue.popleft()
        elif time.monotonic() - s.sent_s >= throttle_s:
            self._send(s, message)

    def _serve_queues(self) -> None:
        while not self._ended.wait(0.001):
            with self._lock:
                for s in self._subscriptions:
                    if s.queue and time.monotonic() - s.sent_s >= s.wish.get("throttle_rate", 0) / 1e3:
                        self._send(s, s.queue.popleft())

    def _send(self, s: Subscription, message: Any) -> None:
        s.sent_s = time.monotonic()
        self.sent += 1
        document = {"op": "publish", "topic": s.wish["topic"], "msg": message}
        with suppress(ConnectionClosed):
            if s.wish.get("compression") == "cbor":
                s.connection.send(cbor2.dumps(packed(document)))
            else:
                for text in self._pieces(json.dumps(document)):
                    s.connection.send(text)

    def _pieces(self, text: str) -> list[str]:
        size = self.fragment
        if size is None:
            return [text]
        parts = [text[i : i + size] for i in range(0, len(text), size)]
        return [
            json.dumps({"op": "fragment", "id": str(self.sent), "data": part, "num": i, "total": len(parts)})
            for i, part in enumerate(parts)
        ]

    # --- a client

    def _talk(self, connection: ServerConnection) -> None:
        self._connections.add(connection)
        try:
            for text in connection:
                wish = json.loads(text)
                self.asked.append(wish)
                self._answer(connection, wish)
        except ConnectionClosed:
            pass
        finally:
            self._connections.discard(connection)
            with self._lock:
                self._subscriptions = [s for s in self._subscriptions if s.connection is not connection]

    def _answer(self, connection: ServerConnection, wish: dict[str, Any]) -> None:
        if wish["op"] == "subscribe":
            with self._lock:
                self._subscriptions = [
                    s
                    for s in self._subscriptions
                    if s.connection is not connection or s.wish["topic"] != wish["topic"]
                ]
                s = Subscription(connection, wish)
                if wish["topic"] not in self.topics and "type" not in wish:
                    text = f"Cannot infer topic type for topic {wish['topic']} as it is not yet advertised"
                    connection.send(json.dumps({"op": "status", "level": "error", "msg": text}))
                    return
                self._subscriptions.append(s)
                if wish["topic"] in self.latched:
                    self._send(s, self.latched[wish["topic"]])
        elif wish["op"] == "call_service":
            values = self._service(wish["service"], wish.get("args", {})) if self.rosapi else None
            answer = {"op": "service_response", "service": wish["service"], "id": wish.get("id")}
            answer |= {"values": values or "Service does not exist", "result": values is not None}
            connection.send(json.dumps(answer))

    def _service(self, name: str, arguments: dict[str, Any]) -> dict[str, Any] | None:
        if name == "/rosapi/topics":
            return {"topics": list(self.topics), "types": list(self.topics.values())}
        if name == "/rosapi/publishers":
            count = self.publishers.get(arguments["topic"], 1)
            return {"publishers": [f"/node{i}" for i in range(count)]}
        if name == "/rosapi/get_param":
            return {"value": json.dumps(self.parameters.get(arguments["name"], arguments.get("default")))}
        return None


def ros_1(type_name: str) -> str:
    return type_name


def ros_2(type_name: str) -> str:
    return type_name.replace("/", "/msg/")


def joint_state(
    stamp_s: float, names: list[str], position: list[Any], version: Callable[[str], str] = ros_2
) -> dict[str, Any]:
    """As the bridges of either ROS write it."""
    sec = int(stamp_s)
    nanoseconds = round((stamp_s - sec) * 1e9)
    stamp = {"secs": sec, "nsecs": nanoseconds} if version is ros_1 else {"sec": sec, "nanosec": nanoseconds}
    header = {"stamp": stamp, "frame_id": ""} | ({"seq": 1} if version is ros_1 else {})
    return {"header": header, "name": names, "position": position, "velocity": [], "effort": []}
