"""`posecast-relay past list`: lists recordings of the past by robot and view."""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from posecast_wire.command_line.progress_bar import ProgressBar

from posecast_relay.archive.names import read_segment_key
from posecast_relay.archive.store import ObjectStore
from posecast_relay.kit import write_count
from posecast_relay.past.address import write_day
from posecast_relay.past.segment import DAY_MS
from posecast_relay.past_command.common import (
    OTHER_VERSION,
    CommandFailed,
    RelayAway,
    add_location,
    add_robot,
    ask_relay,
    find_relay_store,
    open_store,
    write_moment_utc,
)
from posecast_relay.recording.http_source import HttpSource, list_robots
from posecast_relay.recording.source import PastUnreadable

HELP = "list the kept past: from, to, bytes and segments of each robot and view (UTC)"


@dataclass
class KeptSum:
    """The total kept of a view, or of one day of it. Times are unix ms."""

    from_ms: int
    to_ms: int
    bytes: int = 0
    segments: int = 0

    def add(self, from_ms: int, to_ms: int, size: int, segments: int) -> None:
        """Add segments that span `from_ms` to `to_ms`, unix ms."""
        self.from_ms, self.to_ms = min(self.from_ms, from_ms), max(self.to_ms, to_ms)
        self.bytes += size
        self.segments += segments


Key = tuple[str, str, int]  # robot, view, number of the day since 1970


def add_arguments(parser: argparse.ArgumentParser, environ: Mapping[str, str]) -> None:
    """Add the arguments of the command."""
    add_location(parser, environ)
    add_robot(parser, required=False)
    parser.add_argument("--days", action="store_true", help="print a line for each day (UTC)")
    told = "instead: what anyone may look back on at a running relay, such as https://HOST"
    parser.add_argument("--relay", metavar="URL", help=told)


def run(asked: argparse.Namespace) -> None:
    """List the kept past. Raises SettingsError, ArchiveError, CommandFailed and RelayAway."""
    store = None if asked.relay else open_store(asked)
    if asked.relay:
        try:
            days = asyncio.run(sum_relay(asked.relay, asked.robot, asked.view))
        except PastUnreadable as e:
            raise CommandFailed(str(e)) from None
    elif store is None:
        days = _read_rows(ask_relay(asked.past_socket, {"do": "list"}).get("rows"))
        days = {key: found for key, found in days.items() if asked.robot in (None, key[0])}
        kept_at = find_relay_store(asked.past_socket)
        if kept_at is not None:
            print(
                f"{asked.program}: this lists only the relay's memory; to list its store, give "
                f"--past {kept_at}",
                file=sys.stderr,
            )
    else:
        days = asyncio.run(sum_store(store, asked.robot))
    # the index of a relay does not name the size of a segment
    sizes = [] if asked.relay else ["bytes"]
    rows = [["robot", "view", *(["day"] if asked.days else []), "from", "to", *sizes, "segments"]]
    sums = days if asked.days else _sum_views(days)
    for (robot, view, day), found in sorted(sums.items()):
        if asked.view in (None, view):
            rows.append(
                [
                    *(robot, view, *([write_day(DAY_MS * day)] if asked.days else [])),
                    *(write_moment_utc(found.from_ms), write_moment_utc(found.to_ms)),
                    *(f"{found.bytes:,}" for _ in sizes),
                    f"{found.segments:,}",
                ]
            )
    if len(rows) == 1:
        print("nothing is kept" + (f" of {asked.robot}" if asked.robot else ""))
        return
    for line in _align(rows, 1 + len(sizes)):
        print(line)


async def sum_store(store: ObjectStore, robot: str | None) -> dict[Key, KeptSum]:
    """Sum up by day what a store has of one robot, or of all robots. Raises ArchiveError."""
    sums: dict[Key, KeptSum] = {}
    looked = 0
    with ProgressBar(sys.stderr) as bar:
        async for part in store.list_objects(robot or ""):
            looked += len(part)
            bar.show_text(f"scanned {write_count(looked, 'object')}")
            for each in part:
                found = read_segment_key(each.key)
                if found is not None:
                    key = found.name.robot, found.name.view, found.from_ms // DAY_MS
                    row = sums.setdefault(key, KeptSum(found.from_ms, found.to_ms))
                    row.add(found.from_ms, found.to_ms, each.size, 1)
    return sums


async def sum_relay(relay: str, robot: str | None, view: str | None) -> dict[Key, KeptSum]:
    """Sum up by day what anyone may look back on at a relay, of one robot or of all that it lists. A robot
    that nobody may look back on is left out, unless it is the one. Raises PastUnreadable."""
    sums: dict[Key, KeptSum] = {}
    with ProgressBar(sys.stderr) as bar:
        for name in await list_robots(relay) if robot is None else [robot]:
            bar.show_text(f"asking for {name}")
            source = HttpSource(relay, name, view, None)
            try:
                there = await source.find_span()
                for each in (
                    [] if there is None else await source.list_segments(there.from_ms, there.to_ms + 1)
                ):
                    key = name, source.view, each.from_ms // DAY_MS
                    sums.setdefault(key, KeptSum(each.from_ms, each.to_ms)).add(
                        each.from_ms, each.to_ms, 0, 1
                    )
            except PastUnreadable:
                if robot is not None:
                    raise
            finally:
                await source.close()
    return sums


def _read_rows(rows: object) -> dict[Key, KeptSum]:
    try:
        return {
            (str(robot), str(view), int(day)): KeptSum(int(from_ms), int(to_ms), int(size), int(segments))
            for robot, view, day, from_ms, to_ms, size, segments in rows  # type: ignore[attr-defined]
        }
    except (TypeError, ValueError):
        raise RelayAway(OTHER_VERSION) from None


def _sum_views(days: Mapping[Key, KeptSum]) -> dict[Key, KeptSum]:
    sums: dict[Key, KeptSum] = {}
    for (robot, view, _), found in days.items():
        row = sums.setdefault((robot, view, 0), KeptSum(found.from_ms, found.to_ms))
        row.add(found.from_ms, found.to_ms, found.bytes, found.segments)
    return sums


def _align(rows: Sequence[Sequence[str]], numbers_n: int) -> Iterable[str]:
    """Align the columns. The last `numbers_n` are numbers and align right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        texts = [text.ljust(width) for text, width in zip(row[:-numbers_n], widths[:-numbers_n], strict=True)]
        last = zip(row[-numbers_n:], widths[-numbers_n:], strict=True)
        numbers = [text.rjust(width) for text, width in last]
        yield "  ".join([*texts, *numbers])
