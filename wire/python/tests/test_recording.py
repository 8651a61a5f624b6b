"""`recording.json`: what is written is read back, and what is none is refused in one line."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest
from posecast_wire.recording import (
    PastRecording,
    RecordedEvent,
    RecordedSegment,
    RecordedWord,
    RecordingError,
    check_segment,
    decode_recording,
    encode_recording,
    key_page_path,
    model_path,
    pack_segment,
    segment_path,
    unpack_segment,
)
from posecast_wire.segment import SegmentError, SegmentStart

from wire.python.tools.make_recording_vectors import FROM_MS, MODEL, RUN, SCHEMA, TAKE, joined, shown

from .cost import assert_no_faster_than_input

FOLDER = Path(__file__).resolve().parents[2] / "vectors"
VECTORS = json.loads((FOLDER / "recordings.json").read_text(encoding="utf-8"))


def recording(segments: int = 3, **members: Any) -> PastRecording:
    """One with a word and an event in each segment."""
    return PastRecording(
        robot="hubo",
        view="public",
        from_ms=FROM_MS,
        to_ms=FROM_MS + 4000 * segments,
        segments=tuple(segment(i) for i in range(segments)),
        schemas={SCHEMA: "{}"},
        models=(MODEL,),
        **members,
    )


def segment(index: int) -> RecordedSegment:
    from_ms = FROM_MS + 4000 * index
    return RecordedSegment(
        take=int(TAKE, 16),
        run_id=int(RUN, 16),
        index=index,
        from_ms=from_ms,
        to_ms=from_ms + 4000,
        frames=120,
        first_seq=120 * index,
        last_seq=120 * index + 119,
        size=9812,
        schema=SCHEMA,
        model=MODEL,
        missing=0,
        words=(RecordedWord(from_ms, "online"),),
        events=(RecordedEvent(from_ms + 7, {"type": "event", "n": index}),),
    )


def refusal(data: bytes) -> str:
    with pytest.raises(RecordingError) as caught:
        decode_recording(data)
    said = str(caught.value)
    assert said.isprintable()
    assert len(said) < 400
    return said


@pytest.mark.parametrize("case", VECTORS["good"], ids=lambda case: str(case["name"]))
def test_a_recording_is_read(case: dict[str, Any]) -> None:
    data = case["text"].encode()
    found = decode_recording(data)
    assert json.loads(json.dumps(shown(data))) == case["says"]
    again = encode_recording(found)
    assert decode_recording(again) == found
    if "encode" in case:
        assert again == data


@pytest.mark.parametrize("case", VECTORS["bad"], ids=lambda case: str(case["says"]))
def test_a_bad_recording_is_refused_in_these_words(case: dict[str, Any]) -> None:
    assert refusal(joined(case["text"]).encode()) == case["says"]


def test_what_is_written_is_read_back() -> None:
    found = recording(title="é")
    assert decode_recording(encode_recording(found)) == found


def test_what_could_not_be_read_again_is_not_written() -> None:
    wrong = [
        (recording(title=""), "title: must be a text of 1 to 500 characters"),
        (recording(segments=0), "segments: there are none"),
        (dataclasses.replace(recording(), models=()), f"segments[0]: model: {MODEL} is not in the list"),
        (
            dataclasses.replace(recording(), to_ms=FROM_MS + 1),
            "segments[0]: duration: must be a whole number",
        ),
        (recording(author="\ud800"), "recording: not JSON"),
    ]
    for given, says in wrong:
        with pytest.raises(RecordingError) as caught:
            encode_recording(given)
        assert str(caught.value).startswith(says)


def test_bytes_that_are_no_text() -> None:
    for data in (b"\xff", encode_recording(recording()).decode().encode("utf-16")):
        assert refusal(data) == "recording: not JSON"


def test_another_segment_than_its_place_says_is_told() -> None:
    found = recording()
    start = SegmentStart("hubo", "public", int(TAKE, 16), 1, int(RUN, 16), FROM_MS + 4000, SCHEMA)
    check_segment(found, found.segments[1], start)
    for other in ({"robot": "baxter"}, {"view": "lab"}, {"take": 7}, {"index": 2}):
        swapped = dataclasses.replace(start, **other)
        with pytest.raises(RecordingError) as caught:
            check_segment(found, found.segments[1], swapped)
        named = f"{swapped.robot}/{swapped.view}, take {swapped.take:016x}, index {swapped.index}"
        assert str(caught.value) == f"segments/{TAKE}/1.segment: is of {named}"


def test_a_segment_is_read_as_it_is_and_from_its_gzip() -> None:
    for data in (b"", b"\x89PCS", b"\x89PCS" + bytes(5000)):
        assert unpack_segment(pack_segment(data)) == data
        assert unpack_segment(data) == data
    packed = pack_segment(bytes(5000))
    assert packed[:10] == bytes.fromhex("1f8b0800000000000203")  # nothing of the clock
    assert len(packed) < 100


@pytest.mark.parametrize("case", VECTORS["packed"], ids=lambda case: str(case["says"]))
def test_a_packed_segment_of_the_vectors(case: dict[str, Any]) -> None:
    data = b"".join(bytes.fromhex(part[0]) * part[1] for part in case["bytes"])
    try:
        said = f"{len(unpack_segment(data))} bytes"
    except SegmentError as e:
        said = str(e)
    assert said == case["says"]


def test_where_files_lie() -> None:
    assert segment_path(255, 7) == "segments/00000000000000ff/7.segment"
    assert key_page_path(FROM_MS) == "keys/2026-11-22T14-20Z.keys"
    assert key_page_path(FROM_MS + 600_000) == "keys/2026-11-22T14-30Z.keys"
    assert model_path(MODEL, "manifest.json") == f"models/{MODEL}/manifest.json"


def test_reading_costs_no_more_than_in_proportion_to_the_length() -> None:
    assert_no_faster_than_input(lambda n: encode_recording(recording(n)), decode_recording, 200)
