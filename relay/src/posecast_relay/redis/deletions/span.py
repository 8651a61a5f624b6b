"""Deletes a span of a robot's past from Redis: segments, records, their lines in the ledger, schemas that no
segment names any more.
"""

from __future__ import annotations

from posecast_relay.core.past.deletions import Deletion
from posecast_relay.core.past.kept_segment import SegmentName
from posecast_relay.core.past.segment_record import unpack_record
from posecast_relay.redis.client import RedisClient
from posecast_relay.redis.past_scripts import (
    FORGOTTEN_MAX,
    LEDGER,
    LOOK,
    LedgerEntry,
    make_delete_call,
    make_forget_call,
    read_entry,
    stream_key,
)

RECORDS = 100  # in one answer
LOOKS_MAX = 10_000  # for one view


async def delete_span(link: RedisClient, deletion: Deletion) -> int:
    """Delete what a deletion covers, and return how many segments that was; twice does no harm.

    `link` must have been given LOOK, DELETE and FORGET.
    """
    lines = await _read_ledger(link, deletion.robot)
    views = {name.view for name in lines} | ({deletion.view} if deletion.view else set())
    gone: list[LedgerEntry] = []
    for view in sorted(view for view in views if deletion.view in (None, view)):
        gone += await _find_covered(link, deletion, view, lines)
    for at in range(0, len(gone), FORGOTTEN_MAX):
        part = gone[at : at + FORGOTTEN_MAX]
        await link.run_all([make_delete_call(entry) for entry in part])
        known = [lines[entry.name][1] for entry in part if entry.name in lines]
        if known:
            script, keys, args = make_forget_call(deletion.robot, known)
            await link.run(script, keys, *args)
    return len(gone)


async def _read_ledger(link: RedisClient, robot: str) -> dict[SegmentName, tuple[LedgerEntry, bytes]]:
    """Return what the ledger has of a robot, with its lines as they stand there."""
    key = f"{LEDGER}:{robot}"
    if await link.call(link.client.type(key)) != b"zset":
        return {}
    found: dict[SegmentName, tuple[LedgerEntry, bytes]] = {}
    at = 0
    while lines := await link.call(link.client.zrange(key, at, at + FORGOTTEN_MAX - 1)):
        at += len(lines)
        for line in lines:
            try:
                entry = read_entry(robot.encode(), line)
            except ValueError:  # somebody else wrote it
                continue
            found[entry.name] = entry, line
    return found


async def _find_covered(
    link: RedisClient, deletion: Deletion, view: str, lines: dict[SegmentName, tuple[LedgerEntry, bytes]]
) -> list[LedgerEntry]:
    found: list[LedgerEntry] = []
    after = b"-"
    for _ in range(LOOKS_MAX):
        _, _, *told = await link.run(LOOK, [stream_key(deletion.robot, view)], after, RECORDS)
        if not told:
            break
        for record in told[1::2]:
            try:
                segment = unpack_record(deletion.robot, view, record)
            except ValueError:  # gateways show nothing of it either, and it expires
                continue
            if deletion.covers_segment(segment):
                schema = "-" if segment.schema is None else segment.schema.hex()
                entry, _ = lines.get(segment.name, (LedgerEntry(segment.name, schema, 0), b""))
                found.append(entry)
        after = told[-2]
    return found
