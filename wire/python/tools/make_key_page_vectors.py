"""Makes `wire/vectors/key_pages.json`: pages of KEYs with what they say, others that every reader refuses,
and what a writer makes of segments."""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Sequence
from typing import Any

from posecast_wire.key_page import MAGIC, KeyPage, decode_key_page, encode_key_page
from posecast_wire.segment import SegmentError

from wire.python.tools.hand_made import (
    FROM_MS,
    Part,
    frame_record,
    header,
    joined,
    record,
    reserved_frame,
    segment,
    text,
    varint,
)
from wire.python.tools.make_segment_vectors import frames_of, show_parts
from wire.python.tools.vector_script import ARM, COMPACT, ONE, write_document, write_lists

SCHEMA, MODEL = bytes.fromhex("5c" * 32), bytes.fromhex("ab" * 32)


def head(rows: Sequence[tuple[int, int]], digests: Sequence[bytes], **members: bytes) -> bytes:
    """A header of robot `hubo`, view `public`. `members`: other bytes for some."""
    found = {
        "robot": text("hubo"),
        "view": text("public"),
        "from": varint(FROM_MS),
        "takes": varint(len(rows)) + b"".join(struct.pack("<QQ", *row) for row in rows),
        "hashes": varint(len(digests)) + b"".join(digests),
    }
    assert not set(members) - set(found) - {"more"}
    return b"".join((found | members).values())


def pose(*frames: bytes, more: bytes = b"", kind: int = 1, **members: int) -> bytes:
    """An entry. `members`: other numbers for some."""
    found = {
        "moment": 0,
        "take": 0,
        "index": 0,
        "schema": 1,
        "model": 0,
        "late": 0,
        "copies": len(frames) - 1,
    }
    assert not set(members) - set(found)
    numbers = b"".join(map(varint, (found | members).values()))
    content = numbers + b"".join(varint(len(frame)) + frame for frame in frames) + more
    return bytes((kind,)) + varint(len(content)) + content


def page(front: bytes, entries: Sequence[bytes | Part] = (), count: int | None = None) -> list[Part]:
    """A page whose checksums are right."""
    return segment(front, entries, count, MAGIC)


def good() -> list[dict[str, Any]]:
    """Pages that every reader takes."""
    key, *plain = frames_of(ONE, 6)
    arm = frames_of(ARM, 1, first=(1 << 32) - 1)[0]
    one, all_of = head([(7, 9)], [SCHEMA]), head([(7, 9), (3, 9)], [SCHEMA, MODEL])
    several = [
        pose(key, late=12_345),
        pose(key, plain[1], moment=3_999, index=1),
        pose(key, plain[2], moment=8_000, index=2, model=2),
        pose(arm, moment=8_001, take=1, index=4, schema=2, model=1, late=(1 << 53) - 1),
    ]
    furthest = head(
        [((1 << 64) - 1, 1 << 63)],
        [SCHEMA],
        robot=text("0" * 63),
        view=text("a-"),
        **{"from": varint((1 << 53) - 1_200_000)},
    )
    sent: list[tuple[str, bytes, list[bytes]]] = [
        ("a KEY", one, [pose(key)]),
        ("a KEY, copies before a first frame, and another take", all_of, several),
        ("nothing at all", head([], []), []),
        ("the ends of the ranges", furthest, [pose(arm, moment=1_199_999, index=(1 << 32) - 1)]),
    ]
    cases = [{"name": name, "encode": True} | _read(page(front, entries)) for name, front, entries in sent]
    unknown = [
        b"\7" + varint(5) + b"later",
        pose(key, take=1, schema=2, more=b"a member of later"),
        b"\xff\0",
        pose(key, plain[0], moment=1, index=1),
    ]
    later = page(head([(5, 5), (7, 9), (0, 1)], [MODEL, SCHEMA], more=b"a member of later"), unknown)
    return [*cases, {"name": "entries and members of later, and rows that nothing names"} | _read(later)]


def bad() -> list[dict[str, Any]]:
    """Pages that every reader refuses, in the same words."""
    key, *plain = frames_of(ONE, 4)
    ref = reserved_frame(plain[1])
    one = head([(7, 9)], [SCHEMA])
    whole = joined(page(one, [pose(key)]))

    def of(*entries: bytes, count: int | None = None) -> list[Part]:
        return page(one, entries, count)

    def changed(**members: bytes) -> list[Part]:
        return page(head([], [], **members))

    made: list[list[Part]] = [
        *([(whole[:size], 1)] for size in (0, 3, 4, 5, 9, 40, len(whole) - 1, len(whole) - 9)),
        [(whole, 1), (b"\0", 1)],
        [(b"\x89PCS" + whole[4:], 1)],
        [(whole[:4] + b"\2" + whole[5:], 1)],
        [(whole[:5] + struct.pack("<I", (1 << 20) + 1) + whole[9:], 1)],
        [(whole[:20] + b"\xff" + whole[21:], 1)],
        [(whole[:-12] + b"\xff" + whole[-11:], 1)],
        of(pose(key), count=2),
        of(pose(key), count=0),
        of(count=4097),
        changed(robot=text("Hubo")),
        changed(view=text("")),
        changed(**{"from": varint((1 << 53) - 1_199_999)}),
        changed(takes=varint(4097)),
        changed(takes=varint(1) + struct.pack("<QQ", 7, 0)),
        changed(takes=varint(2) + bytes(20)),
        changed(hashes=varint(4097)),
        changed(hashes=varint(2) + bytes(40)),
        changed(hashes=b""),
        of(b"\0\0"),
        of(b"\1"),
        of(b"\1\0"),
        of(b"\1\5\0"),
        of(b"\2\x80\0"),
        of(pose(key, moment=1_200_000)),
        of(pose(key, take=1)),
        of(pose(key, index=1 << 32)),
        of(pose(key, schema=0)),
        of(pose(key, schema=2)),
        of(pose(key, model=2)),
        of(pose(key, late=1 << 53)),
        of(pose(key, copies=3)),
        of(pose(key, copies=1)),
        of(pose(b"")),
        of(pose(key[:17])),
        of(pose(b"\x20" + key[1:])),
        of(pose(plain[0])),
        of(pose(key, key)),
        of(pose(key, key, plain[0])),
        of(pose(ref)),
        of(pose(ref, plain[2])),
        of(pose(key, ref)),
        of(pose(key, ref, plain[2])),
        of(pose(plain[0], plain[1])),
        of(pose(key, moment=5, index=1), pose(key, moment=4, index=2)),
        of(pose(key, moment=5, index=2), pose(key, moment=5, index=1)),
        of(pose(key, moment=5, index=1), pose(key, moment=5, index=1)),
        of(pose(key, moment=5, index=1), pose(key, moment=6, index=1)),
        page(
            one,
            [(b"\1" + varint(65_547) + bytes((0, 0, 0, 1, 0, 0, 0)) + varint(65_537), 1), (b"\0", 65_537)],
            1,
        ),
        page(one, [(b"\2\0", 4097)], 4097),
        page(one, [(b"\2\0", 4097)], 4096),
        page(one, [(b"\2" + varint(1 << 20), 1), (b"\0", 1 << 20)], 1),
    ]
    return [{"says": _refusal(parts), "bytes": show_parts(parts)} for parts in made]


def _read(parts: Sequence[Part]) -> dict[str, Any]:
    return {"bytes": show_parts(parts), "page": shown(decode_key_page(joined(parts)))}


def shown(found: KeyPage) -> dict[str, Any]:
    """As TypeScript can compare it: numbers past 2^53 as digits."""
    poses = [
        {
            **dataclasses.asdict(one),
            "take": f"{one.take:016x}",
            "run_id": f"{one.run_id:016x}",
            "copies": [copy.hex() for copy in one.copies],
            "frame": one.frame.hex(),
        }
        for one in found.poses
    ]
    return {"robot": found.robot, "view": found.view, "from_ms": found.from_ms, "poses": poses}


def written_again(found: KeyPage) -> bytes:
    """The bytes of what was read."""
    return encode_key_page(found.robot, found.view, found.from_ms, found.poses)


def _refusal(parts: Sequence[Part]) -> str:
    try:
        decode_key_page(joined(parts))
    except SegmentError as e:
        return str(e)
    raise AssertionError(f"nothing wrong was found: {joined(parts).hex()[:400]}")


def picks() -> list[dict[str, Any]]:
    """Segments, and the page that a writer makes of them."""
    key, *plain = frames_of(ONE, 9)
    at = {"from": varint(FROM_MS + 1_000)}
    model = record(5, 0, MODEL)
    segments = [
        segment(header(2, 10, 11, 2_000), [frame_record(key, 412, 90), frame_record(plain[0], 33_333)]),
        segment(
            header(1, 14, 14, 2_000, at | {"index": varint(1)}),
            [record(2, 0, key), model, frame_record(plain[3], 1_999)],
        ),
        segment(header(0, 0, 0, 2_000, at | {"index": varint(2)}), [record(6, 5, b"\1")]),
        segment(
            header(1, 13, 13, 9, at | {"index": varint(3)}),
            [record(2, 0, key), frame_record(plain[2], 7_000)],
        ),
        segment(header(1, 10, 10, 9, {"take": struct.pack("<Q", 1)}), [frame_record(key)]),
    ]
    data = [joined(one) for one in segments]
    made = [
        {"every": every, "page": encode_key_page("hubo", "public", FROM_MS, data, every).hex()}
        for every in (1, 2, 3, 9)
    ]
    return [{"segments": [one.hex() for one in data], "from_ms": FROM_MS, "pages": made}]


def files() -> dict[str, str]:
    """The file's name and text: one page a line."""
    taken = good()
    for case in taken:
        if "encode" in case:
            data = b"".join(bytes.fromhex(part) for part in case["bytes"])
            assert written_again(decode_key_page(data)) == data, case["name"]
    lists = {"good": taken, "bad": bad(), "picks": picks()}
    return {"key_pages.json": write_document(write_lists(lists, separators=COMPACT))}
