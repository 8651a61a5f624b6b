"""Makes `wire/vectors/segments.json`: segments with what they say, and others that every reader refuses."""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Sequence
from typing import Any

from posecast_wire import Encoder, Schema
from posecast_wire.segment import (
    CopyRecord,
    EventRecord,
    FrameRecord,
    InfoRecord,
    ModelRecord,
    Segment,
    SegmentError,
    WordRecord,
    decode_segment,
    encode_segment,
)

from wire.python.tools.hand_made import (
    Part,
    digest,
    frame_record,
    header,
    joined,
    record,
    reserved_frame,
    segment,
    text,
    varint,
)
from wire.python.tools.vector_script import ARM, COMPACT, ONE, Dice, write_document, write_lists

KINDS = {
    FrameRecord: "frame",
    CopyRecord: "copy",
    EventRecord: "event",
    InfoRecord: "info",
    ModelRecord: "model",
    WordRecord: "word",
}
EVENT = (
    '{"type":"event","t":1.5,"level":"fault","source":"L","text":"jam","state":"on","n":41,"at":1764000000}'
)
MODEL = "ab" * 32


def frames_of(schema: str, count: int, first: int = 10) -> list[bytes]:
    """Frames of an arm that moves, or of one channel."""
    dice, encoder = Dice(11), Encoder(Schema.parse(schema))
    codes = [dice.near(300) for _ in range(encoder.schema.size)]
    frames: list[bytes] = []
    for i in range(count):
        codes = dice.moved(codes, 9)
        frames.append(encoder.encode(codes, (first + i) % (1 << 32), i / 30, i / 30))
    return frames


def good() -> list[dict[str, Any]]:
    """Segments that every reader takes."""
    arm = frames_of(ARM, 8)
    key, *plain = frames_of(ONE, 6)
    ends = frames_of(ONE, 3, first=(1 << 32) - 2)
    said = [
        record(3, 10_000, EVENT.encode()),
        record(6, 0, b"\1"),
        record(4, 5, varint(2) + text("mode") + text("stehend · 서 있음") + text("") + text("")),
        record(5, 1_000_000, bytes.fromhex(MODEL)),
        record(5, 0, b""),
        record(6, 700_000, b"\2"),
        record(6, 3, b"\0"),
        record(3, 0, b"anything, as long as it is UTF-8: \xf0\x9f\xa6\xbe"),
    ]
    described = {
        "model": digest(MODEL),
        "word": b"\1",
        "numbering": text("r7:3"),
        "event_n": varint(40),
        "info": varint(1) + text("mode") + text("walking"),
        "faults": varint(2) + text(EVENT) + text("{}"),
    }
    furthest = {
        "robot": text("0" * 63),
        "view": text("a-"),
        "take": struct.pack("<Q", (1 << 64) - 1),
        "index": varint((1 << 32) - 1),
        "run": struct.pack("<Q", 1 << 63),
        "from": varint((1 << 53) - 1 - 600_000),
        "missing": varint((1 << 32) - 1),
        "event_n": varint((1 << 53) - 1),
        "numbering": text("é" * 128),
    }
    huge = (1 << 20) - 5
    lost = [key, plain[1], plain[3], plain[4], *frames_of(ONE, 1, first=99)]
    late = [frame_record(frame, 33_333, 12_345 * i) for i, frame in enumerate(arm)]
    behind = [record(3, 7, b"{}"), record(2, 0, key), frame_record(plain[2], 3)]
    at_ends = [frame_record(ends[0], 600_000_999, (1 << 53) - 1), *map(frame_record, ends[1:])]
    gap = {"index": varint(3), "missing": varint(12)}
    sent: list[tuple[str, bytes, list[bytes]]] = [
        ("it begins with a KEY", header(8, 10, 17, 270), late),
        (
            "a KEY of before is copied",
            header(1, 11, 11, 0),
            [record(2, 5, key), frame_record(plain[0], 0, 9)],
        ),
        ("a KEY of before is copied, behind an event", header(1, 13, 13, 1), behind),
        ("frames are missing before it", header(1, 10, 10, 100, gap), [frame_record(key)]),
        ("frames are missing in it", header(5, 10, 99, 400), [frame_record(frame, 66_666) for frame in lost]),
        ("events and changes without frames", header(0, 0, 0, 2_000, described), said),
        (
            "events and changes between frames",
            header(2, 10, 14, 2_000, described),
            [frame_record(key), *said, frame_record(plain[3], 1)],
        ),
        ("nothing at all", header(0, 0, 0, 0), []),
        ("the ends of the ranges", header(3, (1 << 32) - 2, 0, 600_000, furthest), at_ends),
    ]
    cases = [{"name": name, "encode": True} | _read(segment(head, records)) for name, head, records in sent]
    unknown = [record(7, 50, b"later"), frame_record(key, 1), record(255, 2, b""), frame_record(plain[0], 3)]
    later = segment(header(2, 10, 11, 100, {"more": b"a member of later"}), unknown)
    longest = [(record(99, 0, b"", huge), 1), (b"\0", huge)]
    return [
        *cases,
        {"name": "records and members of later: passed over, their time counts"} | _read(later),
        {"name": "a megabyte of records"} | _read(segment(header(0, 0, 0), longest, 1)),
    ]


def bad() -> list[dict[str, Any]]:
    """Segments that every reader refuses, in the same words."""
    key, *plain = frames_of(ONE, 4)
    ref = reserved_frame(plain[1])
    other = frames_of(ARM, 1, first=20)[0]
    one = header(1, 10, 10)
    whole = joined(segment(one, [frame_record(key)]))

    def none(*records: bytes) -> list[Part]:
        return segment(header(0, 0, 0), records)

    def ten(*records: bytes) -> list[Part]:
        return segment(header(len(records), 10, 10), records)

    def head(member: str, changed: bytes) -> list[Part]:
        return segment(header(0, 0, 0, 100, {member: changed}))

    made: list[list[Part]] = [
        *([(whole[:size], 1)] for size in (0, 3, 4, 5, 8, 9, 40, len(whole) - 1, len(whole) - 9)),
        [(whole, 1), (b"\0", 1)],
        [(b"\x88" + whole[1:], 1)],
        [(b"\x89PNG\r\n\x1a\n", 1)],
        [(whole[:4] + b"\2" + whole[5:], 1)],
        [(whole[:4] + b"\0" + whole[5:], 1)],
        [(whole[:5] + struct.pack("<I", (1 << 20) + 1) + whole[9:], 1)],
        [(whole[:30] + b"\xff" + whole[31:], 1)],
        [(whole[:-12] + b"\xff" + whole[-11:], 1)],
        segment(one, [frame_record(key)], 2),
        segment(one, [frame_record(key)], 0),
        segment(header(2, 10, 10), [frame_record(key)]),
        segment(header(0, 10, 10), [frame_record(key)]),
        segment(header(1, 11, 10), [frame_record(key)]),
        segment(header(1, 10, 11), [frame_record(key)]),
        segment(header(0, 1, 0)),
        segment(header(1, 10, 10, 100, {"schema": digest(None)}), [frame_record(key)]),
        segment(header(1, 10, 10, 100, {"run": bytes(8)}), [frame_record(key)]),
        head("robot", text("Hubo")),
        head("robot", text("")),
        head("view", text("a/b")),
        head("view", text("a" * 64)),
        head("index", varint(1 << 32)),
        head("from", varint((1 << 53) - 1)),
        head("from", b"\xff" * 8),
        head("from", b"\xff" * 7 + b"\x7f"),
        head("duration", varint(600_001)),
        head("duration", b"\x80\0"),
        head("frames", varint(1 << 53)),
        head("first", varint(1 << 32)),
        head("schema", b"\1\0"),
        head("model", b"\x21" + bytes(33)),
        head("word", b"\3"),
        head("missing", varint(1 << 32)),
        head("numbering", text("x" * 257)),
        head("numbering", b"\1\xff"),
        head("info", varint(2) + (text("a") + text("")) * 2),
        head("info", varint((1 << 17) + 1)),
        head("info", varint(2) + text("a")),
        head("info", varint(2) + text("") + varint(1 << 17) + b"x" * 10),
        head("faults", varint(101)),
        head("faults", varint(1) + varint(4097)),
        head("numbering", b"\3\xed\xa0\x80"),
        segment(b""),
        segment(header(0, 0, 0)[:-3]),
        none(record(99, 0, b"", 5)),
        none(b"\x63"),
        none(b"\x63\0"),
        none(b"\x63\x80"),
        none(b"\x63\x80\0\0"),
        none(record(0, 0, b"")),
        none(record(99, 101_000, b"")),
        none(record(99, 100_000, b""), record(99, 1_000, b"")),
        none(record(99, (1 << 53) - 1, b"")),
        none(record(3, 0, b"x" * 4097)),
        none(record(3, 0, b"\xc0\x80")),
        none(record(4, 0, varint(1) + text("a"))),
        none(record(4, 0, varint(0) + b"\0")),
        none(record(5, 0, bytes(31))),
        none(record(6, 0, b"")),
        none(record(6, 0, b"\3")),
        none(record(6, 0, b"\0\0")),
        ten(record(1, 0, b"")),
        ten(frame_record(b"")),
        ten(frame_record(b"\x20" + key[1:])),
        ten(frame_record(key[:17])),
        ten(frame_record(plain[0])),
        ten(frame_record(key), frame_record(key)),
        ten(frame_record(plain[1]), frame_record(key)),
        ten(frame_record(key), frame_record(other)),
        ten(frame_record(key), frame_record(plain[1]), frame_record(plain[0])),
        ten(frame_record(ref)),
        ten(frame_record(key), frame_record(ref)),
        ten(frame_record(key), record(2, 0, key)),
        ten(record(2, 0, key), frame_record(key)),
        none(record(2, 0, key)),
        none(record(2, 0, plain[0])),
        none(record(2, 0, key), record(2, 0, key)),
        none(record(2, 0, ref)),
        none(record(2, 0, key), record(2, 0, ref)),
        segment(header(1, 13, 13), [record(2, 0, key), record(2, 0, ref), frame_record(plain[2])]),
        segment(header(1, 10, 10), [(record(1, 0, b"\0" + key[:17], 65_538), 1), (b"\0", 65_520)], 1),
        segment(header(0, 0, 0), [(record(99, 0, b""), 349_526)], 349_526),
    ]
    return [{"says": _refusal(parts), "bytes": show_parts(parts)} for parts in made]


def _read(parts: Sequence[Part]) -> dict[str, Any]:
    data = joined(parts)
    found = decode_segment(data)
    return {"bytes": show_parts(parts), "segment": shown(found), "size": len(data)}


def shown(found: Segment) -> dict[str, Any]:
    """As TypeScript can compare it: numbers past 2^53 as digits, entries of the info as pairs."""
    start = dataclasses.asdict(found.start)
    start |= {"take": f"{found.start.take:016x}", "run_id": f"{found.start.run_id:016x}"}
    start |= {"info": list(found.start.info.items()), "open_faults": list(found.start.open_faults)}
    return {"start": start, "to_ms": found.to_ms, "records": [_shown_record(one) for one in found.records]}


def _shown_record(one: Any) -> list[Any]:
    plain = (list(v.items()) if isinstance(v, dict) else v.hex() if isinstance(v, bytes) else v for v in one)
    return [KINDS[type(one)], *plain]


def show_parts(parts: Sequence[Part]) -> list[Any]:
    """Hexadecimal digits; what repeats stands there once, with how often."""
    shown: list[Any] = []
    for data, times in parts:
        if times > 1:
            shown.append([data.hex(), times])
        elif shown and isinstance(shown[-1], str):
            shown[-1] += data.hex()
        else:
            shown.append(data.hex())
    return shown


def _refusal(parts: Sequence[Part]) -> str:
    try:
        decode_segment(joined(parts))
    except SegmentError as e:
        return str(e)
    raise AssertionError(f"nothing wrong was found: {joined(parts).hex()[:400]}")


def files() -> dict[str, str]:
    """The file's name and text: one segment a line."""
    taken = good()
    for case in taken:
        if "encode" in case:
            data = b"".join(bytes.fromhex(part) for part in case["bytes"])
            assert encode_segment(decode_segment(data)) == data, case["name"]
    lists = {"good": taken, "bad": bad()}
    return {"segments.json": write_document(write_lists(lists, ensure_ascii=False, separators=COMPACT))}
