"""A hub that records, with what it accepted beside: the truth for tests of the past."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from itertools import count
from typing import NamedTuple

from posecast_relay.core.policy import Audience, Policy
from posecast_relay.past.recorder import Recorder, RecordingPorts
from posecast_relay.past.segment import KeptSegment
from posecast_wire import Decoder, Frame, Schema
from posecast_wire.segment import (
    CopyRecord,
    FrameRecord,
    Segment,
    decode_segment,
)

from .sim import UNIX_S, Edge, World, schema


class Accepted(NamedTuple):
    """A frame that the hub took. `unix_s` by the wall clock of then."""

    run_id: int
    seq: int
    frame: bytes
    unix_s: float
    late_s: float


def list_ruled(policy: Policy, robot: str, view: str) -> frozenset[Audience]:
    """Who sees this view live."""
    rules = policy.find_rules(robot)
    return frozenset(by for by, rule in rules.items() if rule.view == view and not rule.blackout)


def make_draw(seed: int) -> Callable[[], int]:
    """Numbers that never come twice, far apart for each seed."""
    drawn = count(seed << 40)
    return lambda: next(drawn)


class TapedWorld(World):
    """A World whose hub has a recorder. `segments` has what that handed over, in order."""

    def __init__(self, seed: int = 1) -> None:
        self.segments: list[KeptSegment] = []
        self.stepped_s = 0.0  # of the wall clock, by hand
        self.accepted: list[Accepted] = []
        self.texts: list[str] = []  # of events
        self.refused: Counter[str] = Counter()
        self._waits: tuple[bytes, int, int] | None = None
        ports = RecordingPorts(
            lambda segment, _now: self.segments.append(segment), make_draw(seed), self.read_unix_s
        )
        self.recorder = Recorder(ports, list_ruled)
        super().__init__(recorder=self.recorder)
        self.recorder.set_policy(Policy(), self.now)

    def read_unix_s(self) -> float:
        """The wall clock."""
        return UNIX_S + self.now + self.stepped_s

    def hear(self, edge: Edge, payload: bytes) -> str:
        """A frame arrives; what becomes of it."""
        outcome = self.publish(edge, payload)
        if outcome == "taken":
            self._accept(edge.run_id, edge.seq, payload)
        elif outcome in ("no base", "no schema"):
            self._waits = payload, edge.run_id, edge.seq
        else:
            self.refused[outcome] += 1
        return outcome

    def hear_answer(self, edge: Edge) -> None:
        """A snapshot arrives. The frame that waited for it is accepted, if it is now what stands there."""
        try:
            self.answer(edge)
        except ValueError:
            self.refused["snapshot"] += 1
            return
        waited, self._waits = self._waits, None
        newest = self.hub.robots["r"].rooms["public"].stream.newest
        if waited is None or newest is None or newest.payload != waited[0] or waited[1] != edge.run_id:
            return
        if (waited[1], waited[2]) not in {(each.run_id, each.seq) for each in self.accepted}:
            self._accept(waited[1], waited[2], waited[0])

    def hear_event(self, edge: Edge, **said: object) -> None:
        """An event, info or model arrives."""
        payload = json.dumps({"type": "event", "t": self.now, "level": "fault"} | said).encode()
        room = self.hub.admit_view("r", "public")
        before = room[1].stream.event_n if room else 0
        self.do(
            self.hub.take_event("r", "public", payload, edge.stamp(self.now), self.now, self.read_unix_s())
        )
        if room and room[1].stream.event_n > before:
            self.texts.append(room[1].stream.events[-1].text)

    def close(self) -> list[KeptSegment]:
        """Close what is open; all segments."""
        self.recorder.close_all(self.now)
        assert not self.recorder.faults, self.recorder.take_faults()
        return self.segments

    def _accept(self, run_id: int, seq: int, payload: bytes) -> None:
        stream = self.hub.robots["r"].rooms["public"].stream
        late_s = stream.compute_age_s(self.now)
        assert late_s is not None
        self.accepted.append(Accepted(run_id, seq, payload, self.read_unix_s(), late_s))


def read_alone(kept: KeptSegment) -> tuple[Segment, list[Frame]]:
    """A segment and its frames, decoded with nothing but itself and its schema."""
    segment = decode_segment(kept.data)
    decoder = Decoder()
    if kept.schema_text is not None:
        decoder.add_schema(kept.schema_text)
    frames: list[Frame] = []
    for record in segment.records:
        if isinstance(record, CopyRecord):
            decoder.decode(record.frame)
        elif isinstance(record, FrameRecord):
            frames.append(decoder.decode(record.frame))
    return segment, frames


def on_air(world: TapedWorld, of: Schema | None = None) -> Edge:
    """A robot whose token, first KEY and snapshot have come."""
    edge = Edge(0xABC, of or schema(), began_s=world.now - 5.0)
    world.do(world.hub.set_token("r", True, world.now))
    world.hear(edge, edge.frame(world.now))
    world.hear_answer(edge)
    return edge
