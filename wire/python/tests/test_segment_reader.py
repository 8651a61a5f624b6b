"""Whatever is written is read back; whatever is damaged is refused in one line."""

from __future__ import annotations

import random
import struct
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_wire import Decoder, Schema
from posecast_wire.segment import (
    CopyRecord,
    EventRecord,
    FrameRecord,
    SegmentError,
    SegmentWriter,
    decode_segment,
    encode_segment,
)

from .cost import assert_no_faster_than_input, lines_run
from .recordings import FROM_MS, Arrival, arrivals, few_frames, plain_start, recorded, segments
from .streams import SLOW

Came = tuple[Schema, list[Arrival]]


def refusal(data: bytes) -> str:
    with pytest.raises(SegmentError) as caught:
        decode_segment(data)
    said = str(caught.value)
    assert said.isprintable()
    assert len(said) < 400
    return said


def small() -> bytes:
    """One segment with all kinds of records."""
    writer = SegmentWriter(plain_start(), *few_frames()[:1])
    writer.append_event('{"n":1}', 0)
    for i, frame in enumerate(few_frames()[1:]):
        writer.append_frame(frame, 33_000 * i, 5)
    writer.append_info({"mode": "walk"}, 200_000)
    writer.append_model("ab" * 32, 200_000)
    writer.append_word("silent", 1_700_000)
    return writer.close(FROM_MS + 1700)


def with_records(data: bytes, records: bytes, count: int) -> bytes:
    """A segment with other records, sound as far as its checksums go."""
    front = data[: 13 + int.from_bytes(data[5:9], "little")]
    return front + records + struct.pack("<BII", 0, count, zlib.crc32(records))


@SLOW
@given(segments())
def test_what_is_written_is_read_and_can_be_written_again(data: bytes) -> None:
    segment = decode_segment(data)
    assert encode_segment(segment) == data
    assert decode_segment(encode_segment(segment)) == segment


@SLOW
@given(arrivals(), st.data())
def test_segments_one_after_the_other_hold_exactly_the_frames(came: Came, data: st.DataObject) -> None:
    schema, accepted = came
    cuts = data.draw(st.lists(st.booleans(), min_size=len(accepted), max_size=len(accepted)))
    found = [decode_segment(one) for one in recorded(accepted, cuts)]
    frames = [(segment.start.from_ms, record) for segment in found for record in segment.frames]
    assert [record.frame for _, record in frames] == [arrival.frame for arrival in accepted]
    assert [record.seq for _, record in frames] == list(range(len(accepted)))
    assert [record.late_us for _, record in frames] == [arrival.late_us for arrival in accepted]
    exact_us = [from_ms * 1000 + record.at_us for from_ms, record in frames]
    assert exact_us == [FROM_MS * 1000 + arrival.at_us for arrival in accepted]
    whole = Decoder()
    whole.add_schema(schema.text)
    states = [whole.decode(arrival.frame) for arrival in accepted]
    for segment in found:  # each by itself, as one who has seen nothing before
        decoder = Decoder()
        decoder.add_schema(schema.text)
        for record in segment.records:
            if isinstance(record, (FrameRecord, CopyRecord)):
                state = decoder.decode(record.frame)
                if isinstance(record, FrameRecord):
                    assert state == states[record.seq]


@SLOW
@given(arrivals(), st.data())
def test_two_recordings_with_gaps_are_merged_by_number(came: Came, data: st.DataObject) -> None:
    _, accepted = came
    merged: dict[int, bytes] = {}
    lost = [data.draw(st.sampled_from((None, 0, 1))) for _ in accepted]
    for recorder in (0, 1):
        cuts = data.draw(st.lists(st.booleans(), min_size=len(accepted), max_size=len(accepted)))
        pairs = zip(accepted, cuts, lost, strict=True)
        keys = [arrival for arrival in accepted if arrival.frame[0] == 0x13]
        kept = [(a, cut) for a, cut, gone in pairs if gone != recorder or a in keys]
        for one in recorded([a for a, _ in kept], [cut for _, cut in kept]):
            merged |= {record.seq: record.frame for record in decode_segment(one).frames}
    assert [merged[seq] for seq in sorted(merged)] == [arrival.frame for arrival in accepted]


@SLOW
@given(segments(), st.data())
def test_no_part_of_a_segment_is_one(data: bytes, dice: st.DataObject) -> None:
    for size in dice.draw(st.lists(st.integers(0, len(data) - 1), min_size=5, max_size=20)):
        refusal(data[:size])
    refusal(data + b"\0")


@SLOW
@given(segments(), st.data())
def test_a_changed_byte_is_refused(data: bytes, dice: st.DataObject) -> None:
    for _ in range(10):
        at = dice.draw(st.integers(0, len(data) - 1))
        flip = dice.draw(st.integers(1, 255))
        refusal(data[:at] + bytes((data[at] ^ flip,)) + data[at + 1 :])


def test_every_byte_and_every_length_of_a_small_one() -> None:
    data = small()
    decode_segment(data)
    for at in range(len(data)):
        refusal(data[:at])
        for bit in range(8):
            refusal(data[:at] + bytes((data[at] ^ 1 << bit,)) + data[at + 1 :])


def test_changes_that_the_checksums_agree_with_are_refused_or_read() -> None:
    data = small()
    size = int.from_bytes(data[5:9], "little")
    rng = random.Random(7)
    refused = 0
    for _ in range(3_000):
        hurt = bytearray(data)
        for _ in range(rng.randint(1, 3)):
            hurt[rng.randrange(9, len(data) - 9)] ^= 1 << rng.randrange(8)
        front, records = bytes(hurt[: 9 + size]), bytes(hurt[13 + size : -9])
        mended = front + struct.pack("<I", zlib.crc32(front))
        mended += records + struct.pack("<BII", 0, 10, zlib.crc32(records))
        try:
            assert encode_segment(decode_segment(mended))
        except SegmentError as e:
            refused += str(e).isprintable()
    assert 1_000 < refused < 3_000


def test_records_of_unknown_kinds_are_passed_over_but_their_time_counts() -> None:
    data = small()
    known = decode_segment(data)
    unknown = bytes((99, 50, 3)) + b"\0\1\2"
    records = data[13 + int.from_bytes(data[5:9], "little") : -9]
    later = decode_segment(with_records(data, unknown + records, 11)).records
    assert [type(r) for r in later] == [type(r) for r in known.records]
    assert [r.at_us - 50 for r in later] == [r.at_us for r in known.records]


def test_members_behind_the_known_ones_are_passed_over() -> None:
    data = small()
    size = int.from_bytes(data[5:9], "little")
    front = data[:5] + struct.pack("<I", size + 3) + data[9 : 9 + size] + b"new"
    longer = front + struct.pack("<I", zlib.crc32(front)) + data[13 + size :]
    assert decode_segment(longer) == decode_segment(data)


def test_a_refusal_names_the_place() -> None:
    data = small()
    assert refusal(b"MCAP0\r\n") == "byte 0: no segment"
    assert refusal(data[:4] + b"\2" + data[5:]) == "byte 4: version 2, made by a newer Posecast"
    assert refusal(data[:7]) == "byte 7: cut short"
    assert refusal(data[:-1]).startswith(f"byte {len(data) - 10}: ")
    event = bytes((3, 0, 2)) + b"\xff{"
    header_end = 13 + int.from_bytes(data[5:9], "little")
    assert refusal(with_records(data, event, 1)) == f"byte {header_end + 3}: event: not UTF-8"


def test_a_megabyte_of_anything_costs_in_proportion() -> None:
    def many(count: int) -> bytes:
        return with_records(small(), bytes((99, 0, 1, 0)) * count, count)

    assert_no_faster_than_input(many, decode_segment, 2_000)
    assert_no_faster_than_input(lambda n: b"\x89PCS\1" + bytes(n), decode_segment, 50_000)
    assert lines_run(decode_segment, many(1_000)) < 100 * 1_000
    text = "{" * 4000
    writer = SegmentWriter(plain_start())
    while writer.has_room(len(text)):
        writer.append_event(text, 0)
    assert len(decode_segment(writer.close(FROM_MS)).records) == (1 << 20) // 4004
    assert isinstance(decode_segment(writer.close(FROM_MS)).records[0], EventRecord)
