"""A ROS 2 robot as Zenoh sees it: keys, tokens and attachments as rmw_zenoh and zenoh-bridge-ros2dds write
them, payloads encoded by hand after the CDR rules (OMG DDS-XTypes 7.4.1, encoding version 1).
"""

from __future__ import annotations

import json
import math
import struct
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest
import zenoh
from posecast_edge.profile.reader import find_profile, load_profile
from posecast_edge.sources.ros.messages import CONTROLLER_STATE, IMU, JOINT_STATE, ODOMETRY
from posecast_edge.sources.ros.ros2 import make_dds_type
from posecast_testing import free_port
from zenoh.ext import CacheConfig, declare_advanced_publisher

GID = bytes(range(16))


class Cdr:
    """Little-endian; every value is aligned to its own size, counted from behind the header."""

    def __init__(self) -> None:
        self._data = bytearray()

    def put(self, form: str, *values: Any) -> Cdr:
        for value in values:
            size = struct.calcsize(f"<{form}")
            self._data += bytes(-len(self._data) % size)
            self._data += struct.pack(f"<{form}", value)
        return self

    def text(self, text: str) -> Cdr:
        raw = text.encode() + b"\0"
        self.put("I", len(raw))
        self._data += raw
        return self

    def texts(self, texts: Sequence[str]) -> Cdr:
        self.put("I", len(texts))
        for text in texts:
            self.text(text)
        return self

    def doubles(self, values: Sequence[float]) -> Cdr:
        return self.put("I", len(values)).put("d", *values)

    def header(self, stamp_s: float, frame: str = "") -> Cdr:
        sec = int(stamp_s)
        return self.put("i", sec).put("I", round((stamp_s - sec) * 1e9)).text(frame)

    def done(self) -> bytes:
        return b"\0\1\0\0" + bytes(self._data)


def joint_state(
    stamp_s: float,
    names: Sequence[str],
    position: Sequence[float] = (),
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
) -> bytes:
    cdr = Cdr().header(stamp_s).texts(names)
    return cdr.doubles(position).doubles(velocity).doubles(effort).done()


def controller_state(stamp_s: float, names: Sequence[str], reference: Sequence[float]) -> bytes:
    """As of Humble and later: reference, feedback, error, output, and more that is left out here only."""
    cdr = Cdr().header(stamp_s).texts(names)
    for positions in (reference, [9.0] * len(names), [8.0] * len(names), ()):
        cdr.doubles(positions).doubles(()).doubles(()).doubles(()).put("i", 0).put("I", 0)
    return cdr.texts(()).done()


def imu(
    stamp_s: float,
    frame: str,
    quat: Sequence[float] = (1, 0, 0, 0),
    gyro: Sequence[float] = (0, 0, 0),
    acc: Sequence[float] = (0, 0, 9.81),
    oriented: bool = True,
) -> bytes:
    """`quat`: w x y z. Without an orientation its covariance begins with -1."""
    w, x, y, z = quat
    cdr = Cdr().header(stamp_s, frame).put("d", x, y, z, w)
    cdr.put("d", 0.0 if oriented else -1.0, *([0.0] * 8))
    return cdr.put("d", *gyro, *([0.0] * 9), *acc, *([0.0] * 9)).done()


def wrench(stamp_s: float, frame: str, force: Sequence[float], torque: Sequence[float]) -> bytes:
    return Cdr().header(stamp_s, frame).put("d", *force, *torque).done()


def battery(
    stamp_s: float, volt: float, amp: float, share: float, status: int = 2, present: bool = True
) -> bytes:
    cdr = (
        Cdr().header(stamp_s).put("f", volt, 25.0, amp, 1.0, 2.0, 2.0, share).put("B", status, 1, 2, present)
    )
    for _ in range(2):  # cell voltages, cell temperatures
        cdr.put("I", 2).put("f", 3.7, 3.7)
    return cdr.text("slot").text("serial").done()


def diagnostics(stamp_s: float, *statuses: tuple[int, str, str]) -> bytes:
    """(level, name, message)."""
    cdr = Cdr().header(stamp_s).put("I", len(statuses))
    for level, name, message in statuses:
        cdr.put("B", level).text(name).text(message).text("id").put("I", 1).text("key").text("value")
    return cdr.done()


def transforms(stamp_s: float, *chain: tuple[str, str, Sequence[float], Sequence[float]]) -> bytes:
    """(parent, child, xyz, wxyz) of each."""
    cdr = Cdr().put("I", len(chain))
    for parent, child, xyz, (w, x, y, z) in chain:
        cdr.header(stamp_s, parent).text(child).put("d", *xyz, x, y, z, w)
    return cdr.done()


def odometry(stamp_s: float, position: Sequence[float], quat: Sequence[float]) -> bytes:
    w, x, y, z = quat
    cdr = Cdr().header(stamp_s, "odom").text("base_link").put("d", *position, x, y, z, w, *([0.0] * 36))
    return cdr.put("d", *([0.0] * 6), *([0.0] * 36)).done()


def text_message(text: str) -> bytes:
    return Cdr().text(text).done()


@dataclass
class Graph:
    """The robot's router, and its nodes in one session beside it."""

    port: int = field(default_factory=free_port)
    router: zenoh.Session | None = None
    nodes: zenoh.Session | None = None
    held: list[Any] = field(default_factory=list)
    _publishers: dict[str, Any] = field(default_factory=dict)
    _ids: int = 0

    @property
    def source(self) -> str:
        return f"ros2:127.0.0.1:{self.port}"

    def start(self) -> Graph:
        scouting = {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}}
        common = {"scouting": scouting, "transport": {"shared_memory": {"enabled": False}}}
        endpoint = [f"tcp/127.0.0.1:{self.port}"]
        router = {
            "mode": "router",
            "listen": {"endpoints": endpoint},
            "adminspace": {"enabled": True},
        } | common
        self.router = zenoh.open(zenoh.Config.from_json5(json.dumps(router)))
        nodes = {"mode": "client", "connect": {"endpoints": endpoint}} | common
        nodes["timestamping"] = {"enabled": True}
        self.nodes = zenoh.open(zenoh.Config.from_json5(json.dumps(nodes)))
        return self

    def stop(self) -> None:
        for session in (self.nodes, self.router):
            if session is not None:
                session.close()  # type: ignore[no-untyped-call]
        self.nodes = self.router = None
        self.held.clear()
        self._publishers.clear()

    def publish(self, topic: str, type_name: str, payload: bytes, domain: int = 0) -> None:
        """As a node of rmw_zenoh does; the first time it makes itself known."""
        key = f"{domain}{topic}/{make_dds_type(type_name)}/RIHS01_{'ab' * 32}"
        publisher = self._publishers.get(key)
        if publisher is None:
            self.declare(topic, type_name, domain)
            assert self.nodes is not None
            publisher = self._publishers[key] = self.nodes.declare_publisher(key)
        publisher.put(payload, attachment=struct.pack("<qqB", 1, time.time_ns(), len(GID)) + GID)

    def declare(self, topic: str, type_name: str, domain: int = 0) -> None:
        """The token of a publisher."""
        assert self.nodes is not None
        self._ids += 1
        name = topic.replace("/", "%")
        where = f"{self.nodes.zid()}/0/{self._ids}/MP/%/%/node"
        token = f"@ros2_lv/{domain}/{where}/{name}/{make_dds_type(type_name)}/RIHS01_{'ab' * 32}/::,10:,:,:,,"
        self.held.append(self.nodes.liveliness().declare_token(token))

    def latch(self, topic: str, type_name: str, payload: bytes) -> None:
        """A publisher with durability transient local, and what it has published."""
        assert self.nodes is not None
        self.declare(topic, type_name)
        key = f"0{topic}/{make_dds_type(type_name)}/RIHS01_{'cd' * 32}"
        publisher = declare_advanced_publisher(
            self.nodes, key, cache=CacheConfig(max_samples=1), publisher_detection=True
        )
        publisher.put(payload)
        self.held.append(publisher)

    def bridge(self, topic: str, type_name: str) -> Callable[[bytes], None]:
        """A topic of zenoh-bridge-ros2dds: no type in its key."""
        assert self.nodes is not None
        package, _, name = type_name.partition("/")
        ke = topic.lstrip("/").replace("/", "§")
        token = f"@/{self.nodes.zid()}/@ros2_lv/MP/{ke}/{package}§msg§{name}/::,10:,:,:,,"
        self.held.append(self.nodes.liveliness().declare_token(token))
        publisher = self.nodes.declare_publisher(topic.lstrip("/"))
        self.held.append(publisher)
        return publisher.put


def main() -> None:
    """`python ros_stage.py`: a Unitree G1 that moves, seen by rmw_zenoh; prints the source for an agent."""
    names = load_profile(find_profile("g1")).labels["joint"]
    graph = Graph().start()
    print(graph.source, flush=True)
    while True:
        t_s = time.monotonic()
        # within every limit
        pos = [0.1 + 0.1 * math.sin(3 * t_s + i) for i in range(len(names))]
        graph.publish("/joint_states", JOINT_STATE, joint_state(t_s, names, pos))
        told = controller_state(t_s, names, [p / 2 for p in pos])
        graph.publish("/legs_controller/controller_state", CONTROLLER_STATE, told)
        graph.publish("/imu", IMU, imu(t_s, "pelvis"))
        turn = 0.1 * math.sin(t_s)
        where = odometry(t_s, (math.sin(t_s), 0, 0.79), (math.cos(turn), 0, 0, math.sin(turn)))
        graph.publish("/odom", ODOMETRY, where)
        time.sleep(0.01)


if __name__ == "__main__":
    main()


@pytest.fixture
def graph() -> Iterator[Graph]:
    g = Graph().start()
    yield g
    g.stop()
