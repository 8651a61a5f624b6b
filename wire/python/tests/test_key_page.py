"""Pages of KEYs: what is written is read back, and poses are those of their segments."""

from __future__ import annotations

import hashlib
import json
import struct
import zlib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_wire import Decoder, Encoder, Schema
from posecast_wire.key_page import (
    PAGE_BYTES_MAX,
    POSES_MAX,
    KeyPose,
    decode_key_page,
    encode_key_page,
    pick_pose,
)
from posecast_wire.segment import SegmentError, SegmentWriter, decode_segment

from wire.python.tools.make_key_page_vectors import shown, written_again

from .cost import assert_no_faster_than_input, lines_run
from .recordings import FROM_MS, Arrival, arrivals, few_frames, one_channel, plain_start, recorded
from .streams import SLOW
from .test_segment_vectors import bytes_of

FOLDER = Path(__file__).resolve().parents[2] / "vectors"
VECTORS = json.loads((FOLDER / "key_pages.json").read_text(encoding="utf-8"))
KEPT = FOLDER / "key_pages/demo.pck"  # as version 1 wrote it: never made again
KEPT_SHA256 = "6b2afd62789cb2cc95a94ad4822fa6e27dd43d3cc4902e64bf6b20da183a9cfd"
Came = tuple[Schema, list[Arrival]]


def refusal(data: bytes) -> str:
    with pytest.raises(SegmentError) as caught:
        decode_key_page(data)
    said = str(caught.value)
    assert said.isprintable()
    assert len(said) < 400
    return said


def poses(count: int, frame: bytes = few_frames(1)[0], every_ms: int = 1) -> list[KeyPose]:
    """A KEY over and over."""
    return [KeyPose(FROM_MS + every_ms * i, 7, 9, i, "5c" * 32, None, 0, 10, (), frame) for i in range(count)]


def page(count: int, frame: bytes = few_frames(1)[0], every: int = 1) -> bytes:
    return encode_key_page("hubo", "public", FROM_MS, poses(count, frame), every)


@pytest.mark.parametrize("case", VECTORS["good"], ids=lambda case: str(case["name"]))
def test_a_page_is_read(case: dict[str, Any]) -> None:
    data = bytes_of(case["bytes"])
    found = decode_key_page(data)
    assert json.loads(json.dumps(shown(found))) == case["page"]
    assert decode_key_page(written_again(found)) == found
    if "encode" in case:
        assert written_again(found) == data


@pytest.mark.parametrize("case", VECTORS["bad"], ids=lambda case: str(case["says"]))
def test_a_bad_page_is_refused_in_these_words(case: dict[str, Any]) -> None:
    assert refusal(bytes_of(case["bytes"])) == case["says"]


def test_a_page_is_made_of_segments_in_any_order_whole_or_as_bytes() -> None:
    (case,) = VECTORS["picks"]
    raw = [bytes.fromhex(digits) for digits in case["segments"]]
    for made in case["pages"]:
        expected = bytes.fromhex(made["page"])
        for segments in (raw, raw[::-1], [*map(decode_segment, raw)]):
            assert encode_key_page("hubo", "public", case["from_ms"], segments, made["every"]) == expected
    found = decode_key_page(bytes.fromhex(case["pages"][0]["page"])).poses
    assert [(one.take, one.index, one.at_ms - FROM_MS, one.seq, one.late_us) for one in found] == [
        (1, 0, 0, 10, 0),
        (7, 0, 0, 10, 90),
        (7, 1, 1_001, 14, 0),
        (7, 3, 1_007, 13, 0),
    ]
    assert [one.model for one in found] == [None, None, "ab" * 32, None]
    assert [len(one.copies) for one in found] == [0, 0, 1, 1]


def test_a_kept_page_has_the_poses_of_the_kept_segments() -> None:
    data = KEPT.read_bytes()
    assert hashlib.sha256(data).hexdigest() == KEPT_SHA256, "never change it"
    segments = [file.read_bytes() for file in (FOLDER / "segments").glob("*.pcs")]
    picked = [pose for pose in map(pick_pose, segments) if pose is not None]
    found = decode_key_page(data)
    assert (found.robot, found.view, len(found.poses)) == ("demo", "public", 4)
    assert found.poses == tuple(sorted(picked, key=lambda pose: pose.at_ms))


@SLOW
@given(arrivals(), st.data())
def test_every_pose_is_the_first_one_of_its_segment(came: Came, dice: st.DataObject) -> None:
    schema, accepted = came
    cuts = dice.draw(st.lists(st.booleans(), min_size=len(accepted), max_size=len(accepted)))
    whole = Decoder()
    whole.add_schema(schema.text)
    states = {frame.seq: frame for frame in (whole.decode(arrival.frame) for arrival in accepted)}
    segments = recorded(accepted, cuts)
    data = encode_key_page("hubo", "public", FROM_MS, segments)
    found = decode_key_page(data)
    assert [one.index for one in found.poses] == list(range(len(segments)))
    for one, raw in zip(found.poses, segments, strict=True):
        segment = decode_segment(raw)
        first = segment.frames[0]
        assert pick_pose(raw) == pick_pose(segment) == one
        assert (one.seq, one.late_us, one.frame) == (first.seq, first.late_us, first.frame)
        assert one.at_ms == segment.start.from_ms + first.at_us // 1000
        decoder = Decoder()
        decoder.add_schema(schema.text)
        for copy in one.copies:
            decoder.decode(copy)
        assert decoder.decode(one.frame) == states[one.seq]
    assert written_again(found) == data


def test_every_byte_and_every_length_of_a_small_one() -> None:
    data = page(2)
    for at in range(len(data)):
        refusal(data[:at])
        for bit in range(8):
            refusal(data[:at] + bytes((data[at] ^ 1 << bit,)) + data[at + 1 :])


def test_changes_that_the_checksums_agree_with_are_refused_or_read() -> None:
    data = page(3)
    size = int.from_bytes(data[5:9], "little")
    refused = 0
    for at in [*range(9, 9 + size), *range(13 + size, len(data) - 9)]:
        for bit in range(8):
            hurt = bytearray(data)
            hurt[at] ^= 1 << bit
            front, entries = bytes(hurt[: 9 + size]), bytes(hurt[13 + size : -9])
            mended = front + struct.pack("<I", zlib.crc32(front))
            mended += entries + struct.pack("<BII", 0, 3, zlib.crc32(entries))
            try:
                found = decode_key_page(mended)
            except SegmentError as e:
                refused += str(e).isprintable()
            else:
                assert decode_key_page(written_again(found)) == found
    assert refused > 200


def test_segments_without_frames_are_not_in_it_nor_counted() -> None:
    writer = SegmentWriter(plain_start(1, FROM_MS + 1))
    writer.append_word("silent", 0)
    empty = writer.close(FROM_MS + 2)
    assert pick_pose(empty) is None
    assert pick_pose(decode_segment(empty)) is None
    given_poses: list[bytes | KeyPose] = [*poses(1), empty, *poses(5)[2:]]
    found = decode_key_page(encode_key_page("hubo", "public", FROM_MS, given_poses, 2)).poses
    assert [one.index for one in found] == [0, 3]


@pytest.mark.parametrize(
    ("segments", "why"),
    [
        ([b"x"], "byte 0: no segment"),
        ([SegmentWriter(plain_start()).close(FROM_MS)], "segment: of hubo/public, not hubo/lab"),
        (poses(1) * 2, "segment: take 0000000000000007, index 0: given twice"),
        (poses(2, every_ms=-1), "moment: -1, 0 to 1199999 allowed"),
        (poses(2, every_ms=1_200_000), "moment: 1200000, 0 to 1199999 allowed"),
        (poses(1, few_frames(2)[1]), "frame: its base"),
    ],
)
def test_what_can_not_be_in_a_page_is_refused(segments: list[bytes | KeyPose], why: str) -> None:
    with pytest.raises(SegmentError, match=f"^{why}"):
        encode_key_page("hubo", "lab", FROM_MS, segments)


def test_a_damaged_segment_is_refused_wherever_the_damage_is() -> None:
    (data,) = recorded([Arrival(frame, 0, 0, None) for frame in few_frames()], [False] * 6)
    number_of_records = range(len(data) - 8, len(data) - 4)
    for at in set(range(len(data))) - set(number_of_records):
        with pytest.raises(SegmentError):
            pick_pose(data[:at] + bytes((data[at] ^ 1,)) + data[at + 1 :])


def test_more_than_fits_is_thinned_evenly() -> None:
    large = few_frames(1)[0] + bytes(60_000)
    data = page(40, large)
    assert len(data) <= PAGE_BYTES_MAX
    assert [one.index for one in decode_key_page(data).poses] == list(range(0, 40, 4))
    assert [one.index for one in decode_key_page(page(40, large, 3)).poses] == list(range(0, 40, 3))
    assert len(decode_key_page(page(POSES_MAX)).poses) == POSES_MAX
    assert len(decode_key_page(page(POSES_MAX + 1)).poses) == POSES_MAX // 2 + 1


def test_making_one_looks_at_the_beginning_of_each_segment_alone() -> None:
    def segment(frames: int) -> bytes:
        encoder = Encoder(one_channel())
        writer = SegmentWriter(plain_start())
        for i in range(frames):
            writer.append_frame(encoder.encode([i], i, i / 30, 0.0), i, 0)
        return writer.close(FROM_MS + 1_000)

    assert lines_run(pick_pose, segment(3_000)) < lines_run(pick_pose, segment(2)) + 20  # longer numbers
    assert_no_faster_than_input(page, decode_key_page, 200)
    assert_no_faster_than_input(poses, lambda found: encode_key_page("a", "a", FROM_MS, found), 200)
