"""Segments for property tests: streams of frames, recorded with whatever else falls into them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hypothesis import strategies as st
from posecast_wire import Encoder, Schema, build_schema_text, parse_header
from posecast_wire.segment import SegmentStart, SegmentWriter
from posecast_wire.segment.records import WORDS

from .streams import streams

U64 = st.integers(0, (1 << 64) - 1)
U32 = st.integers(0, (1 << 32) - 1)
HASH = st.binary(min_size=32, max_size=32).map(bytes.hex)
TEXT = st.text(max_size=20)
INFO = st.dictionaries(TEXT, TEXT, max_size=4)
WORD = st.sampled_from(WORDS)
FROM_MS = 1_764_000_000_000

STARTS = st.builds(
    SegmentStart,
    robot=st.sampled_from(("hubo", "a", "0-" * 31)),
    view=st.sampled_from(("public", "lab-1")),
    take=U64,
    index=U32,
    run_id=st.integers(1, (1 << 64) - 1),
    from_ms=st.integers(0, 1 << 52),
    schema=HASH,
    model=st.none() | HASH,
    word=WORD,
    missing=U32,
    numbering=TEXT,
    event_n=st.integers(0, (1 << 53) - 1),
    info=INFO,
    open_faults=st.lists(TEXT, max_size=3).map(tuple),
)


@dataclass(frozen=True)
class Arrival:
    """A frame that a relay accepted. `key`: the KEY that it had before, if any."""

    frame: bytes
    at_us: int
    late_us: int
    key: bytes | None


def one_channel() -> Schema:
    """The smallest schema."""
    return Schema.parse(build_schema_text("one", {"x": ["x"]}, [{"name": "x", "labels": "x"}]))


def few_frames(count: int = 6) -> list[bytes]:
    """Frames of one channel, the first one a KEY."""
    encoder = Encoder(one_channel())
    return [encoder.encode([i], 10 + i, i / 30, i / 30) for i in range(count)]


def plain_start(index: int = 0, from_ms: int = FROM_MS) -> SegmentStart:
    """A header without anything special."""
    return SegmentStart("hubo", "public", 7, index, 9, from_ms, "5c" * 32)


def accepted(frames: list[bytes], waits_us: list[int]) -> list[Arrival]:
    """What a relay accepts of frames that have all come, one after the other."""
    found: list[Arrival] = []
    key: bytes | None = None
    at_us = 0
    for frame, wait_us in zip(frames, waits_us, strict=True):
        at_us += wait_us
        found.append(Arrival(frame, at_us, wait_us // 7, key))
        if parse_header(frame).is_key:
            key = frame
    return found


@st.composite
def arrivals(draw: st.DrawFn) -> tuple[Schema, list[Arrival]]:
    """A schema and frames that all came, 0 to 70 ms apart."""
    schema, states = draw(streams())
    encoder = Encoder(schema, draw(st.sampled_from([0.2, 4.0])))
    frames = [encoder.encode(codes, i, i / 10, i / 10) for i, codes in enumerate(states)]
    waits_us = draw(st.lists(st.integers(0, 70_000), min_size=len(frames), max_size=len(frames)))
    return schema, accepted(frames, waits_us)


def recorded(came: list[Arrival], cuts: list[bool]) -> list[bytes]:
    """Segments of them, the next one begun before each frame for which `cuts` says so."""
    segments: list[bytes] = []
    writer: SegmentWriter | None = None
    from_us = FROM_MS * 1000
    for arrival, cut in zip(came, cuts, strict=True):
        now_us = FROM_MS * 1000 + arrival.at_us
        if writer is None or cut:
            if writer is not None:
                segments.append(writer.close(now_us // 1000))
            from_us = now_us // 1000 * 1000
            start = plain_start(len(segments), now_us // 1000)
            writer = SegmentWriter(start, arrival.key)
        writer.append_frame(arrival.frame, now_us - from_us, arrival.late_us)
    if writer is not None:
        segments.append(writer.close((FROM_MS * 1000 + came[-1].at_us) // 1000))
    return segments


@st.composite
def segments(draw: st.DrawFn) -> bytes:
    """A segment with frames or without, and with anything else before, between and behind them."""
    _, came = draw(arrivals())
    came = came[draw(st.integers(0, len(came))) :]
    start = draw(STARTS)
    if not came:
        start = replace(start, schema=None, run_id=0)
    writer = SegmentWriter(start, came[0].key if came else None)
    at_us = 0
    for arrival in [*came, None]:
        for _ in range(draw(st.integers(0, 2))):
            at_us += draw(st.integers(0, 999_999))
            _append_other(draw, writer, at_us)
        if arrival is not None:
            at_us += draw(st.integers(0, 99_999))
            writer.append_frame(arrival.frame, at_us, arrival.late_us)
    return writer.close(start.from_ms + at_us // 1000 + draw(st.integers(0, 10)))


def _append_other(draw: st.DrawFn, writer: SegmentWriter, at_us: int) -> None:
    kind = draw(st.integers(0, 3))
    if kind == 0:
        writer.append_event(draw(TEXT), at_us)
    elif kind == 1:
        writer.append_info(draw(INFO), at_us)
    elif kind == 2:
        writer.append_model(draw(st.none() | HASH), at_us)
    else:
        writer.append_word(draw(WORD), at_us)
