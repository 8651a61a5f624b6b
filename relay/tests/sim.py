"""Parts for tests of the core by plain calls: an edge that only encodes, and viewers that only read."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any

from posecast_relay.core.actions import Abort, Action, CloseConnection, Fault, Persist, RequestSnapshot, Send
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.viewer import Viewer
from posecast_relay.past.recorder import Recorder
from posecast_wire import Close, Decoder, Encoder, Frame, Schema, Snapshot, Stamp, build_schema_text

UNIX_S = 1_800_000_000.0


def schema(names: Sequence[str] = ("RKN", "LKN"), scale: float = 0.001) -> Schema:
    """A small schema; other names or another scale make another one."""
    fields = [{"name": "pos", "labels": "joint", "unit": "rad", "scale": scale}]
    return Schema.parse(build_schema_text("sim", {"joint": names}, fields))


def mixed() -> Schema:
    """Numbers and flags."""
    fields: list[dict[str, object]] = [
        {"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.01},
        {"name": "flags", "labels": "joint", "bits": ["jam", "homed"]},
    ]
    return Schema.parse(build_schema_text("sim", {"joint": ["RKN", "LKN"]}, fields))


class Edge:
    """One run of an edge: frames with their stamps, and its snapshot. Its clock is the test's."""

    def __init__(self, run_id: int, of: Schema, began_s: float = 0.0, key_every_s: float = 30.0) -> None:
        self.run_id = run_id
        self.schema = of
        self.began_s = began_s
        self.seq = -1
        self.info: dict[str, str] = {}
        self.model: str | None = None
        self.codes: list[int] = [0] * of.size
        self._encoder = Encoder(of, key_every_s)

    def stamp(self, now: float) -> Stamp:
        """What is attached to a message sent at `now`."""
        return Stamp(self.run_id, max(0, round((now - self.began_s) * 1e9)))

    def frame(self, now: float, codes: Sequence[int] | None = None, force_key: bool = False) -> bytes:
        """The next frame."""
        self.seq = (self.seq + 1) % (1 << 32)
        self.codes = list(codes) if codes is not None else [self.seq % 1000] * self.schema.size
        return self._encoder.encode(self.codes, self.seq, now, now, force_key)

    def snapshot(self) -> Snapshot:
        """What it answers; it has sent a KEY before."""
        assert self._encoder.key is not None
        return Snapshot(self.schema.text, self.info, self._encoder.key, self.model)


def split(data: bytes) -> Iterable[tuple[int, bytes]]:
    """WebSocket messages as the relay packs them: opcode and payload."""
    at = 0
    while at < len(data):
        opcode, size, at = data[at] & 0x0F, data[at + 1], at + 2
        if size == 126:
            size, at = int.from_bytes(data[at : at + 2], "big"), at + 2
        elif size == 127:
            size, at = int.from_bytes(data[at : at + 8], "big"), at + 8
        yield opcode, data[at : at + size]
        at += size


class Screen:
    """A viewer's far end: what it was told and what it decoded. Every frame must decode at once."""

    descriptor = -1

    def __init__(self) -> None:
        self.decoder = Decoder()
        self.texts: list[dict[str, Any]] = []
        self.frames: list[Frame] = []  # all binary messages
        self.states: list[Frame] = []  # the last one of each write
        self.pings = 0
        self.writes = 0
        self.ended: tuple[Close, str, float | None] | None = None
        self.lane: str | None = None
        self.was_cut: Close | None = None

    def write(self, data: bytes) -> None:
        """Outlet: read everything at once."""
        assert self.ended is None
        assert self.was_cut is None
        self.writes += 1
        before = len(self.frames)
        for opcode, payload in split(data):
            if opcode == 1:
                doc = json.loads(payload)
                self.texts.append(doc)
                if doc["type"] == "schema":
                    self.decoder.add_schema(payload.decode())
            elif opcode == 2:
                self.frames.append(self.decoder.decode(payload))
            else:
                self.pings += 1
        if len(self.frames) > before:
            self.states.append(self.frames[-1])

    def end(self, close: Close, reason: str, retry_s: float | None, lane: str | None = None) -> None:
        """Outlet."""
        self.ended, self.lane = (close, reason, retry_s), lane

    def cut(self, close: Close) -> None:
        """Outlet."""
        self.was_cut = close

    def told(self, kind: str) -> list[dict[str, Any]]:
        """The messages of one type."""
        return [doc for doc in self.texts if doc["type"] == kind]


class World:
    """A hub and a clock. Actions are carried out on the screens; questions to edges are counted."""

    def __init__(self, limits: Limits | None = None, recorder: Recorder | None = None) -> None:
        self.limits = limits or Limits()
        self.hub = Hub(self.limits, recorder=recorder)
        self.now = 1000.0
        self.asked: list[str] = []
        self.kept = 0

    def do(self, actions: Iterable[Action]) -> None:
        """Carry out."""
        for action in actions:
            match action:
                case Send(data, viewers):
                    for viewer in viewers:
                        viewer.outlet.write(data)
                case CloseConnection(viewer, close, reason, retry_s, lane):
                    viewer.outlet.end(close, reason, retry_s, lane)
                case Abort(viewer, close):
                    viewer.outlet.cut(close)
                case RequestSnapshot(robot, views):
                    assert views == ("public",)
                    self.asked.append(robot)
                case Persist():
                    self.kept += 1
                case Fault(_, error):
                    raise error

    def pass_time(self, seconds: float) -> None:
        """Let the clock run, with every tick at its moment."""
        until = self.now + seconds
        while self.hub.wake_at <= until:
            self.now = max(self.now, self.hub.wake_at)
            self.do(self.hub.tick(self.now, UNIX_S))
            assert self.hub.wake_at > self.now
        self.now = until

    def flush(self) -> None:
        """Hand out what has come."""
        self.do(self.hub.flush(self.now, UNIX_S))

    def publish(self, edge: Edge, payload: bytes | None = None, robot: str = "r") -> str:
        """A frame arrives at once and is handed out; returns what became of it."""
        data = edge.frame(self.now) if payload is None else payload
        outcome = self.hub.receive_frame(robot, "public", data, edge.stamp(self.now), self.now)
        self.flush()
        return outcome.value

    def answer(self, edge: Edge, robot: str = "r") -> None:
        """The edge's snapshot arrives."""
        self.hub.take_snapshot(robot, "public", edge.snapshot(), edge.stamp(self.now), self.now)
        self.flush()

    def on_air(self, of: Schema | None = None, key_every_s: float = 30.0, robot: str = "r") -> Edge:
        """A robot whose token, first KEY and snapshot have come."""
        edge = Edge(0xABC, of or schema(), began_s=self.now - 5.0, key_every_s=key_every_s)
        self.do(self.hub.set_token(robot, True, self.now))
        self.publish(edge, robot=robot)
        self.answer(edge, robot)
        return edge

    def join(self, hz: float = 30.0, robot: str = "r") -> tuple[Viewer, Screen]:
        """A viewer comes."""
        screen = Screen()
        viewer = Viewer(screen, robot, "public", hz, self.limits, self.now)
        self.do(self.hub.join(viewer, self.now, UNIX_S))
        return viewer, screen

    def say(self, viewer: Viewer, **doc: object) -> None:
        """A viewer's message."""
        viewer.record_heard(self.now)
        self.do(self.hub.take_message(viewer, json.dumps(doc).encode(), self.now))

    def run(self, edge: Edge, seconds: float, hz: float = 30.0) -> None:
        """Frames at a steady rate."""
        for _ in range(round(seconds * hz)):
            self.pass_time(1 / hz)
            self.publish(edge)
