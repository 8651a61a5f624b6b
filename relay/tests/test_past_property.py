"""Whatever a hub is given, what it accepted is what its segments say: frame by frame and byte by byte."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from itertools import pairwise

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from posecast_relay.past.segment import KeptSegment
from posecast_testing import count_examples
from posecast_wire import parse_header
from posecast_wire.segment import (
    EventRecord,
    InfoRecord,
    ModelRecord,
    Segment,
    WordRecord,
    decode_segment,
    merge_segments,
)

from .sim import Edge, schema
from .taped_world import TapedWorld, read_alone

SCHEMAS = (schema(), schema(("RKN", "LKN", "WST")), schema(scale=0.5))
SEQS = 1 << 32


class Story:
    """Two relays that hear one robot, each with losses of its own. The robot restarts, and an older run of it
    may go on beside the newer one."""

    def __init__(self) -> None:
        self.worlds = (TapedWorld(1), TapedWorld(2))
        self.truth: dict[tuple[int, int], tuple[int, ...]] = {}
        self.edges: list[Edge] = []
        for world in self.worlds:
            world.do(world.hub.set_token("r", True, world.now))
        self.restart(0, 30.0, 0, True)

    @property
    def now(self) -> float:
        return self.worlds[0].now

    def restart(self, which: int, key_every_s: float, seq: int, is_heard: bool) -> None:
        edge = Edge(len(self.edges) + 1, SCHEMAS[which], began_s=self.now, key_every_s=key_every_s)
        edge.seq = seq - 1
        self.edges.append(edge)
        if is_heard:
            self.publish([1, 2, 3], 0, 0, 1)
            for n in range(len(self.worlds)):
                self.answer(n, 1)

    def stream(self, count: int, wait_s: float, key_every: int, lost_every: tuple[int, int]) -> None:
        """Frames at a steady rate, of which each relay loses some."""
        for n in range(count):
            self.pass_time(wait_s)
            lost = sum(1 << which for which, every in enumerate(lost_every) if every and n % every == 0)
            self.publish([n, -n, 2 * n], lost, n % key_every, 1)

    def publish(self, codes: list[int], lost: int, key: int, of_older: int) -> None:
        """`lost`: a bit for each relay. `key`: forced if 0. `of_older`: another run sends it if 0."""
        edge = self.edges[-2 if of_older == 0 and len(self.edges) > 1 else -1]
        payload = edge.frame(self.now, codes[: edge.schema.size], key == 0)
        self.truth[edge.run_id, edge.seq] = tuple(edge.codes)
        for n, world in enumerate(self.worlds):
            if not lost >> n & 1:
                world.hear(edge, payload)

    def answer(self, n: int, of_older: int) -> None:
        edge = self.edges[-2 if of_older == 0 and len(self.edges) > 1 else -1]
        if (edge.run_id, edge.seq) in self.truth:
            self.worlds[n].hear_answer(edge)

    def tell(self, what: int, n: int) -> None:
        edge, word = self.edges[-1], f"w{n % 3}"
        if what == 0:
            edge.info = {"n": word}
        elif what == 1:
            edge.model = f"{n:064x}"
        for world in self.worlds:
            if what == 0:
                world.hear_event(edge, type="info", kv=edge.info)
            elif what == 1:
                world.hear_event(edge, type="model", hash=edge.model)
            else:
                world.hear_event(edge, source="RKN", text=word, state=("on", "off")[what % 2])

    def pass_time(self, seconds: float) -> None:
        for world in self.worlds:
            world.pass_time(seconds)

    def step_clock(self, n: int, seconds: float) -> None:
        self.worlds[n].stepped_s += seconds

    def set_token(self, n: int, present: bool) -> None:
        world = self.worlds[n]
        world.do(world.hub.set_token("r", present, world.now))

    def play(self, steps: Sequence[tuple[object, ...]]) -> None:
        for name, *about in steps:
            getattr(self, str(name))(*about)


codes = st.lists(st.integers(-2000, 2000), min_size=3, max_size=3)
frame = st.tuples(
    st.just("publish"), codes, st.sampled_from([0, 0, 0, 0, 1, 2, 3]), st.integers(0, 5), st.integers(0, 9)
)
span = st.tuples(st.just("pass_time"), st.sampled_from([0.001, 1 / 30, 0.1, 0.4, 0.999, 1.2, 2.5, 7.0]))
losses = st.sampled_from([0, 0, 0, 1, 2, 7])
stream = st.tuples(
    *(st.just("stream"), st.integers(1, 40), st.sampled_from([1 / 60, 1 / 30, 0.1, 0.3])),
    *(st.sampled_from([1, 3, 11, 40]), st.tuples(losses, losses)),
)
step = st.one_of(
    frame,
    stream,
    stream,
    stream,
    span,
    st.tuples(st.just("answer"), st.integers(0, 1), st.integers(0, 9)),
    st.tuples(
        *(st.just("restart"), st.integers(0, 2), st.sampled_from([30.0, 0.5, 0.05])),
        *(st.sampled_from([0, 7, SEQS - 3]), st.booleans()),
    ),
    st.tuples(st.just("tell"), st.integers(0, 5), st.integers(0, 9)),
    st.tuples(st.just("step_clock"), st.integers(0, 1), st.sampled_from([-3600.0, -1.5, -0.4, 0.4, 2.0])),
    st.tuples(st.just("set_token"), st.integers(0, 1), st.booleans()),
)


@settings(max_examples=count_examples(100), deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(step, min_size=12, max_size=40))
def test_segments_say_what_was_accepted(steps: list[tuple[object, ...]]) -> None:
    story = Story()
    story.play(steps)
    merged: list[Segment] = []
    for world in story.worlds:
        segments = world.close()
        check_world(world, segments, story.truth)
        merged += [decode_segment(kept.data) for kept in segments]
    check_merged(story, merged)


def check_merged(story: Story, segments: list[Segment]) -> None:
    """Both relays' segments together have each frame that one of them took, once and in order."""
    taken = {(each.run_id, each.seq): each.frame for world in story.worlds for each in world.accepted}
    runs = merge_segments(segments)
    assert {(run.run_id, each.seq): each.frame for run in runs for each in run.frames} == taken
    assert sum(len(run.frames) for run in runs) == len(taken)
    for run in runs:
        assert all((b.seq - a.seq) % SEQS < SEQS // 2 for a, b in pairwise(run.frames))


def check_world(
    world: TapedWorld, kept: list[KeptSegment], truth: dict[tuple[int, int], tuple[int, ...]]
) -> None:
    """What one relay recorded."""
    decoded: list[Segment] = []
    for each in kept:
        segment, frames = read_alone(each)
        check_index(each, segment)
        check_rules(segment)
        seen = [(segment.start.run_id, shown.seq, tuple(shown.codes)) for shown in frames]
        assert seen == [(run_id, seq, truth[run_id, seq]) for run_id, seq, _ in seen]
        decoded.append(segment)
    check_frames(world, decoded)
    check_chain(world, decoded)
    texts = [record.text for each in decoded for record in each.records if isinstance(record, EventRecord)]
    assert [text for text in texts if json.loads(text)["source"] != "relay"] == world.texts


def check_index(kept: KeptSegment, segment: Segment) -> None:
    """What is told of a segment is what stands in it."""
    start, frames = segment.start, segment.frames
    assert (kept.name.robot, kept.name.view) == (start.robot, start.view)
    assert (kept.name.take, kept.name.index, kept.run) == (start.take, start.index, start.run_id)
    assert (kept.from_ms, kept.to_ms, kept.missing) == (start.from_ms, segment.to_ms, start.missing)
    assert kept.frames == len(frames)
    assert (kept.first_seq, kept.last_seq) == ((frames[0].seq, frames[-1].seq) if frames else (0, 0))
    assert (None if kept.schema is None else kept.schema.hex()) == start.schema
    if kept.schema is not None and kept.schema_text is not None:
        assert hashlib.sha256(kept.schema_text.encode()).digest() == kept.schema
    assert hashlib.sha256(kept.data).digest() == kept.sha256
    assert kept.model == start.model
    told = [(r.at_us // 1000, r.text) for r in segment.records if isinstance(r, EventRecord)]
    assert [(event.at_ms - start.from_ms, event.text) for event in kept.events] == told
    words = [(r.at_us // 1000, r.word) for r in segment.records if isinstance(r, WordRecord)]
    assert [(each.at_ms - start.from_ms, each.word) for each in kept.words] == [(0, start.word), *words]
    begun = [(doc["level"], doc["state"]) for doc in (json.loads(text) for _, text in told)]
    assert kept.faults == begun.count(("fault", "on"))


def check_rules(segment: Segment) -> None:
    """It ended when it had to."""
    records = segment.records
    assert records, "nothing happened in it"
    began_us = records[0].at_us
    assert segment.to_ms - segment.start.from_ms <= 6000
    for record in segment.frames[1:]:
        assert not parse_header(record.frame).is_key or record.at_us - began_us < 1_000_000
    for other in records[:-1]:
        assert not isinstance(other, WordRecord) or other.word == "online"


def check_frames(world: TapedWorld, segments: list[Segment]) -> None:
    """Each frame that was accepted stands there once, in order, with its time and lateness."""
    told = [
        (s.start.run_id, r.seq, r.frame, 1000 * s.start.from_ms + r.at_us, r.late_us)
        for s in segments
        for r in s.frames
    ]
    assert [each[:3] for each in told] == [each[:3] for each in world.accepted]
    for (*_, at_us, late_us), accepted in zip(told, world.accepted, strict=True):
        assert abs(at_us / 1e6 - accepted.unix_s) < 1.001
        assert abs(late_us / 1e6 - accepted.late_s) < 2e-6


def check_chain(world: TapedWorld, segments: list[Segment]) -> None:
    """Each goes on where the one before ended, and tells what lies between."""
    names = [(each.start.take, each.start.index) for each in segments]
    assert len(set(names)) == len(names)
    last_seq: int | None = None
    for before, after in pairwise([None, *segments]):
        assert after is not None
        start, frames = after.start, after.frames
        if before is None or before.start.take != start.take:
            assert start.index == 0
            last_seq = None
        else:
            assert start.index == before.start.index + 1
            assert start.run_id == before.start.run_id
            assert start.from_ms >= before.to_ms
        if before is not None:
            assert (start.word, start.info, start.model, start.event_n) == read_end(before)
        missing = 0 if last_seq is None or not frames else (frames[0].seq - last_seq - 1) % SEQS
        assert start.missing == missing
        last_seq = frames[-1].seq if frames else last_seq
    if segments:
        room = world.hub.robots["r"].rooms["public"]
        assert read_end(segments[-1])[1:] == (room.stream.info, room.stream.model, room.stream.event_n)


def read_end(segment: Segment) -> tuple[str, dict[str, str], str | None, int]:
    """Word, info, model and newest event's number when it ended."""
    start = segment.start
    word, info, model, event_n = str(start.word), dict(start.info), start.model, start.event_n
    for record in segment.records:
        if isinstance(record, WordRecord):
            word = record.word
        elif isinstance(record, InfoRecord):
            info = dict(record.info)
        elif isinstance(record, ModelRecord):
            model = record.model
        elif isinstance(record, EventRecord):
            assert json.loads(record.text)["n"] == event_n + 1
            event_n += 1
    return word, info, model, event_n
