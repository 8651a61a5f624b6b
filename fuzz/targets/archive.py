"""What a relay reads in an object store: names, indexes, days, tombstones, segments whose index is gone."""

from __future__ import annotations

from dataclasses import replace

from posecast_relay.archive.deletion import KEY, make_stem
from posecast_relay.archive.index import make_segment_record, pack_index, unpack_index
from posecast_relay.archive.names import ArchivedName, is_unfinished, read_segment_key
from posecast_relay.past.deletions import pack_deletion, unpack_deletion
from posecast_relay.past.index import digest_page, list_shown, pack_day, unpack_day
from posecast_relay.past.segment import SegmentName, pack_record, unpack_record
from posecast_wire.segment import SegmentError, decode_segment

from fuzz.target import Differs, Target

PAGE_MS = 1_795_000_800_000  # 2026-11-18T11:20Z
DAY_MS = PAGE_MS - PAGE_MS % 86_400_000


def key(data: bytes) -> None:
    """What is taken for a segment's key is the only one that we would write for what it says."""
    text = data.decode("utf-8", "surrogateescape")
    is_unfinished(text)
    found = read_segment_key(text)
    if found is not None and found.key != text:
        raise Differs(f"{text!r} is read as {found.key}")


def index(data: bytes) -> None:
    """What is taken can be packed, and is then the same; it can be summed up."""
    found = unpack_index("r", "public", PAGE_MS, data)
    if unpack_index("r", "public", PAGE_MS, pack_index("r", "public", PAGE_MS, found)) != found:
        raise Differs("packed it is another")
    digest_page(PAGE_MS, found)


def day(data: bytes) -> None:
    """Likewise."""
    found = unpack_day("r", "public", DAY_MS, data)
    if unpack_day("r", "public", DAY_MS, pack_day(found)) != found:
        raise Differs("packed it is another")
    list_shown(found)


def segment(data: bytes) -> None:
    """What is said of a segment can be packed and read again: it stands in an index then."""
    start = decode_segment(data).start
    name = SegmentName(start.robot, start.view, start.take, start.index)
    to_ms = decode_segment(data).to_ms
    found = make_segment_record(ArchivedName(name, start.from_ms, to_ms, len(data), frozenset()), data)
    again = unpack_record(start.robot, start.view, pack_record(found))
    if replace(again, audiences=found.audiences) != found:
        raise Differs("packed it is another")


def deletion(data: bytes) -> None:
    """A tombstone, or a deletion in Redis: what is taken can be packed, is the same, and reaches back."""
    found = unpack_deletion(data)
    if unpack_deletion(pack_deletion(found)) != found:
        raise Differs("packed it is another")
    if found.covers(found.robot, found.view or "public", found.at_ms, found.at_ms + 1000):
        raise Differs("it covers what came after it was ordered")
    if not found.covers(found.robot, found.view or "public", found.from_ms, found.from_ms + 1000) and (
        found.to_ms > found.from_ms
    ):
        raise Differs("it does not cover its own beginning")
    if KEY.fullmatch(f"{make_stem(found)}.json") is None:
        raise Differs("its key is not read as one")


TARGETS = (
    Target("archive-key", key),
    Target("archive-index", index, (ValueError,), stretched=1 << 18),
    Target("archive-day", day, (ValueError,), stretched=1 << 18),
    Target("deletion", deletion, (ValueError,)),
    Target("archive-segment", segment, (SegmentError,), corpus="segment"),
)
