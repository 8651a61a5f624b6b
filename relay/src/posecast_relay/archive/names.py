"""Writes and reads the keys of the past in an object store. A key in any other form is foreign: None.

    {robot}/{view}/{2026-11-22}/{14-20}/{from_ms}-{to_ms}-{take}-{index}-{bytes}-{audiences}.segment
    {robot}/{view}/{2026-11-22}/{14-20}/index.json      of these ten minutes (UTC)
    {robot}/{view}/{2026-11-22}/day.json
    {robot}/schemas/{sha256}.json

`take` is 16 hexadecimal digits; `audiences` one letter each, sorted: a anyone, l link, s signed-in; x none.
A key alone is enough to find a segment and to decide who may see it.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from posecast_wire.keys import ROBOT_ID

from posecast_relay.core.policy import Audience
from posecast_relay.past.address import AddressError, read_span, write_day
from posecast_relay.past.segment import (
    DAY_MS,
    PAGE_MS,
    SEGMENT_BYTES_MAX,
    SPAN_MS_MAX,
    U32_MAX,
    WHOLE_MAX,
    KeptSegment,
    SegmentName,
    pack_audiences,
    unpack_audiences,
)

KEY_CHARS_MAX = 400
INDEX_NAME, DAY_NAME = "index.json", "day.json"
SCHEMAS, MODELS, TOMBSTONES = "schemas", "models", "tombstones"
PAGE = re.compile(r"([01][0-9]|2[0-3])-([0-5])0", re.ASCII)
UNFINISHED = re.compile(r"#[0-9]{1,9}$", re.ASCII)
NUMBER = r"(0|[1-9][0-9]{0,15})"
SEGMENT = re.compile(rf"{NUMBER}-{NUMBER}-([0-9a-f]{{16}})-{NUMBER}-{NUMBER}-(a?l?s?|x)\.segment", re.ASCII)


PageKey = tuple[str, str, int]  # robot, view, and when the ten minutes begin, unix ms


class ArchivedName(NamedTuple):
    """The facts in a segment's key. Times are unix ms; `size` is in bytes."""

    name: SegmentName
    from_ms: int
    to_ms: int
    size: int
    audiences: frozenset[Audience]

    @property
    def page_ms(self) -> int:
        """The start of the ten minutes in which it begins, unix ms."""
        return self.from_ms - self.from_ms % PAGE_MS

    @property
    def key(self) -> str:
        """The key. The same content always has the same key."""
        letters = pack_audiences(self.audiences)
        file = f"{self.from_ms}-{self.to_ms}-{self.name.take:016x}-{self.name.index}-{self.size}-{letters}"
        return f"{make_page_folder(self.name.robot, self.name.view, self.page_ms)}/{file}.segment"


def name_segment(segment: KeptSegment) -> ArchivedName:
    """Return the facts that a segment's key holds."""
    return ArchivedName(segment.name, segment.from_ms, segment.to_ms, segment.size, segment.audiences)


def read_segment_key(key: str) -> ArchivedName | None:
    """Parse a segment's key; None if it is not one, or not in the form that we write."""
    if len(key) > KEY_CHARS_MAX or key.count("/") != 4:
        return None
    robot, view, _, _, file = key.split("/")
    found = SEGMENT.fullmatch(file)
    if found is None or not found[6] or not may_be_archived(robot, view):
        return None
    from_ms, to_ms, index, size = (int(found[n]) for n in (1, 2, 4, 5))
    if from_ms > WHOLE_MAX - SPAN_MS_MAX or index > U32_MAX or size > SEGMENT_BYTES_MAX:
        return None
    if not from_ms <= to_ms <= from_ms + SPAN_MS_MAX:
        return None
    audiences = unpack_audiences(found[6])
    name = SegmentName(robot, view, int(found[3], 16), index)
    read = ArchivedName(name, from_ms, to_ms, size, audiences)
    try:
        return read if read.key == key else None
    except (ValueError, OverflowError):
        return None  # a time outside the calendar


def is_unfinished(key: str) -> bool:
    """Whether this is an incomplete object of ours in a file store: being written, or left by a killed
    process.

    An object gets its final name once it is complete.
    """
    whole = UNFINISHED.sub("", key)
    return whole != key and (
        read_segment_key(whole) is not None or whole.rpartition("/")[2] in (INDEX_NAME, DAY_NAME)
    )


def make_view_folder(robot: str, view: str) -> str:
    """Return the folder of a robot's view."""
    return f"{robot}/{view}"


def make_day_folder(robot: str, view: str, day_ms: int) -> str:
    """Return the folder of the day (UTC) that contains `day_ms`, unix ms."""
    return f"{robot}/{view}/{write_day(day_ms)}"


def make_page_folder(robot: str, view: str, page_ms: int) -> str:
    """Return the folder of the ten minutes that contain `page_ms`, unix ms."""
    return f"{robot}/{view}/{write_day(page_ms)}/{write_page(page_ms)}"


def make_index_key(robot: str, view: str, page_ms: int) -> str:
    """Return the key of the index of ten minutes."""
    return f"{make_page_folder(robot, view, page_ms)}/{INDEX_NAME}"


def make_day_key(robot: str, view: str, day_ms: int) -> str:
    """Return the key of a day's summary."""
    return f"{make_day_folder(robot, view, day_ms)}/{DAY_NAME}"


def make_schema_key(robot: str, sha256: bytes) -> str:
    """Return the key of a schema's text."""
    return f"{robot}/{SCHEMAS}/{sha256.hex()}.json"


def write_page(unix_ms: int) -> str:
    """Return the ten minutes of a time within its day as they appear in a key: 14-20."""
    minute = unix_ms % DAY_MS // 60_000
    return f"{minute // 60:02d}-{minute % 60 // 10}0"


def read_day(text: str) -> int | None:
    """Parse the name of a day's folder and return the day's start, unix ms; None if it is invalid."""
    try:
        span = read_span(text)
    except AddressError:
        return None
    return span.from_ms if span.is_day else None


def read_page(text: str) -> int | None:
    """Parse the name of a ten-minute folder and return its start within the day, ms; None if it is
    invalid."""
    found = PAGE.fullmatch(text)
    return None if found is None else int(found[1]) * 3_600_000 + int(found[2]) * PAGE_MS


def may_be_archived(robot: str, view: str) -> bool:
    """Whether a robot and view can be stored: not if a name equals one of our folders."""
    names = ROBOT_ID.fullmatch(robot) and ROBOT_ID.fullmatch(view)
    return bool(names) and robot != TOMBSTONES and view not in (SCHEMAS, MODELS)
