"""What a recorder may rely on: sizes, copies, and refusals that change nothing."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import pytest
from posecast_wire import Encoder, Schema
from posecast_wire.segment import (
    CopyRecord,
    EventRecord,
    FrameRecord,
    SegmentError,
    SegmentWriter,
    decode_segment,
    encode_segment,
)
from posecast_wire.segment.records import RECORDS_BYTES_MAX

from .cost import lines_run
from .recordings import FROM_MS, few_frames, one_channel, plain_start


def test_the_key_is_copied_only_before_a_first_frame_that_is_no_key() -> None:
    key, plain, _, after = few_frames(4)
    writer = SegmentWriter(plain_start(), key)
    writer.append_event("{}", 1_000)
    assert writer.append_frame(after, 2_500, 300) == 13
    records = decode_segment(writer.close(FROM_MS + 2)).records
    assert records == (
        EventRecord(1_000, "{}"),
        CopyRecord(2_500, key),
        FrameRecord(2_500, 300, 13, after),
    )
    writer = SegmentWriter(plain_start(), key)
    assert writer.append_frame(plain, 0, 0) == 11
    assert len(decode_segment(writer.close(FROM_MS)).records) == 2
    writer = SegmentWriter(plain_start(), key)
    writer.append_frame(Encoder(one_channel()).encode([5], 14, 1.0, 0.0), 0, 0)
    assert [type(r) for r in decode_segment(writer.close(FROM_MS)).records] == [FrameRecord]


def test_what_is_refused_changes_nothing() -> None:
    key, plain, _, again = few_frames(4)
    writer = SegmentWriter(plain_start())
    with pytest.raises(SegmentError, match=r"^frame: its base [0-9a-f]{8} is not here$"):
        writer.append_frame(plain, 0, 0)
    writer.append_frame(key, 1_000, 0)
    writer.append_frame(plain, 2_000, 0)
    before = writer.close(FROM_MS + 2)
    other = Encoder(other_schema()).encode([1], 20, 1.0, 0.0)
    for frame, why in (
        (plain, "frame: number 11 after 11"),
        (b"", "frame: empty frame"),
        (b"\x20" * 40, "frame: version 2"),
        (b"\x12" + again[1:], "^frame: REF frames are reserved$"),
        (again[:1] + b"\0\0\0\0" + again[5:], "its base 00000000 is not here"),
        (other, "a KEY of another schema"),
    ):
        with pytest.raises(SegmentError, match=why):
            writer.append_frame(frame, 3_000, 0)
    with pytest.raises(SegmentError, match="at 1999 µs, the one before at 2000 µs"):
        writer.append_frame(again, 1_999, 0)
    with pytest.raises(SegmentError, match="lateness: -1, 0 to 9007199254740991 allowed"):
        writer.append_frame(again, 3_000, -1)
    with pytest.raises(SegmentError, match="event: 4097 bytes, 4096 allowed"):
        writer.append_event("x" * 4097, 3_000)
    with pytest.raises(SegmentError, match="event: not Unicode"):
        writer.append_event("\ud800", 3_000)
    with pytest.raises(SegmentError, match="info: 131076 bytes, 131072 allowed"):
        writer.append_info({"": "x" * ((1 << 17) - 1)}, 3_000)
    with pytest.raises(SegmentError, match="model: no SHA-256"):
        writer.append_model("AB" * 32, 3_000)
    with pytest.raises(SegmentError, match="word: 'alive' is none"):
        writer.append_word("alive", 3_000)  # type: ignore[arg-type]
    assert writer.close(FROM_MS + 2) == before
    assert (writer.frames, writer.last_seq, writer.count) == (2, 11, 2)


def other_schema() -> Schema:
    """A schema of one channel under another name."""
    return Schema.parse(one_channel().text.replace('"one"', '"two"'))


@pytest.mark.parametrize(
    ("members", "why"),
    [
        ({"robot": "Hubo"}, "header: robot 'Hubo': use 1 to 63"),
        ({"view": "*"}, "header: view '*': use 1 to 63"),
        ({"take": 1 << 64}, "header: take and run are u64"),
        ({"index": -1}, "index: -1, 0 to 4294967295 allowed"),
        ({"schema": "5c"}, "schema: no SHA-256"),
        ({"numbering": "é" * 129}, "numbering: 258 bytes, 256 allowed"),
        ({"open_faults": ("{}",) * 101}, "open faults: 101, 100 allowed"),
        ({"event_n": 1 << 53}, "event n: 9007199254740992, 0 to 9007199254740991 allowed"),
    ],
)
def test_a_header_that_can_not_be_read_is_refused_at_the_beginning(
    members: dict[str, object], why: str
) -> None:
    with pytest.raises(SegmentError) as caught:
        SegmentWriter(replace(plain_start(), **members))  # type: ignore[arg-type]
    assert str(caught.value).startswith(why)


def test_an_end_before_the_newest_record_and_frames_without_a_schema_are_refused() -> None:
    writer = SegmentWriter(replace(plain_start(), schema=None))
    writer.append_frame(few_frames()[0], 5_000, 0)
    with pytest.raises(SegmentError, match="4 ms, its newest record at 5 ms"):
        writer.close(FROM_MS + 4)
    with pytest.raises(SegmentError, match="600001 ms"):
        writer.close(FROM_MS + 600_001)
    with pytest.raises(SegmentError, match="frames without a schema"):
        writer.close(FROM_MS + 5)


def test_records_fill_a_megabyte_and_no_more() -> None:
    frames = few_frames(2)
    writer = SegmentWriter(plain_start(), frames[0])
    while writer.has_room(4096):
        writer.append_event("x" * 4096, 0)
    assert writer.has_room(100)
    while writer.has_room(1):
        writer.append_event("x", 0)
    with contextlib.suppress(SegmentError):  # `has_room` is careful by some bytes
        for _ in range(20):
            writer.append_event("", 0)
    with pytest.raises(SegmentError, match=f"bytes, {RECORDS_BYTES_MAX} allowed"):
        writer.append_frame(frames[1], 0, 0)
    data = writer.close(FROM_MS)
    assert abs(writer.size - len(data)) <= 60
    assert encode_segment(decode_segment(data)) == data
    assert len(data) - 9 - 13 - int.from_bytes(data[5:9], "little") in range(
        RECORDS_BYTES_MAX - 2, 1 << 20 | 1
    )


def test_a_frame_costs_some_forty_lines() -> None:
    frames = few_frames(101)
    writer = SegmentWriter(plain_start())
    writer.append_frame(frames[0], 0, 0)

    def append(given: list[bytes]) -> None:
        for i, frame in enumerate(given):
            writer.append_frame(frame, 33_333 * i, 700)

    assert lines_run(append, frames[1:]) < 100 * 80
    assert lines_run(writer.close, FROM_MS + 4_000) < 150


def test_what_is_missing_may_be_known_later() -> None:
    writer = SegmentWriter(plain_start())
    writer.append_event("{}", 1_000)
    with pytest.raises(SegmentError, match="missing: -1"):
        writer.set_missing(-1)
    writer.set_missing(7)
    writer.append_frame(few_frames(1)[0], 2_000, 0)
    assert decode_segment(writer.close(FROM_MS + 2)).start == replace(plain_start(), missing=7)
