"""`posecast-relay past delete`: deletes all or part of a robot's past from every place that keeps it."""

from __future__ import annotations

import argparse
import asyncio
import secrets
import sys
import time
from collections.abc import Mapping

from posecast_wire.command_line.progress_bar import ProgressBar

from posecast_relay.archive.deletion import Erased, erase, find_covered, put_tombstone
from posecast_relay.archive.names import TOMBSTONES
from posecast_relay.archive.store import NO_SPACE, ArchiveError, ArchiveRefused, ObjectStore
from posecast_relay.config.settings import SettingsError
from posecast_relay.kit import write_count
from posecast_relay.past.deletions import Deletion, pack_deletion
from posecast_relay.past_command.common import (
    OTHER_VERSION,
    CommandFailed,
    RelayAway,
    add_location,
    add_robot,
    ask_relay,
    find_relay_store,
    open_store,
    read_end,
    read_start,
    write_span,
)

HELP = "delete all or part of a robot's past from the store, Redis and, within 10 s, running relays"
LATER = (
    "Running relays delete it within 10 s, open pages within half a minute. For up to an hour, caches can "
    "hold public copies; the browsers of those who looked, for up to two hours."
)


def add_arguments(parser: argparse.ArgumentParser, environ: Mapping[str, str]) -> None:
    """Add the arguments of the command."""
    add_location(parser, environ)
    add_robot(parser, required=True)
    form = "2026-11-22T14:20 with or without a zone, 14:20 for today, or 2026-11-22 for the start of that day"
    to = "end of the time span, same formats; a date means the end of that day"
    parser.add_argument("--from", dest="from_ms", metavar="TIME", type=read_start, help=f"start: {form}")
    parser.add_argument("--to", dest="to_ms", metavar="TIME", type=read_end, help=to)
    parser.add_argument(
        "--all", action="store_true", help="delete everything recorded until now (replaces --from and --to)"
    )
    parser.add_argument("--yes", action="store_true", help="do not ask for confirmation")


def make_deletion(robot: str, view: str | None, from_ms: int, to_ms: int, now_ms: int) -> Deletion:
    """Order a deletion of what lies between two times, unix ms; it ends now at the latest."""
    return Deletion(robot, view, from_ms, min(to_ms, now_ms), now_ms, secrets.token_hex(8))


def run(asked: argparse.Namespace) -> None:
    """Delete what was asked for. Raises SettingsError, ArchiveError, RelayAway, CommandFailed."""
    now_ms = time.time_ns() // 1_000_000
    from_ms, to_ms = _read_span(asked, now_ms)
    deletion = make_deletion(asked.robot, asked.view, from_ms, to_ms, now_ms)
    store = open_store(asked)
    what = _describe(deletion, asked.all)
    if store is None:
        kept_at = find_relay_store(asked.past_socket)
        if kept_at is not None:
            raise CommandFailed(
                "nothing was deleted: this relay also keeps the past in a store; delete it there, and it "
                f"leaves the relay's memory too: use --past {kept_at}"
            )
        _confirm(asked.yes, f"{what}, from the relay's memory and its Redis.")
        told = ask_relay(asked.past_socket, {"do": "delete", "deletion": pack_deletion(deletion).decode()})
        segments, size = told.get("segments"), told.get("bytes")
        if not isinstance(segments, int) or not isinstance(size, int):
            raise RelayAway(OTHER_VERSION)
        print(f"deleted from memory: {_write_sum(segments, size)}. {LATER}")
        return
    asyncio.run(_delete(store, deletion, what, asked))


async def _delete(store: ObjectStore, deletion: Deletion, what: str, asked: argparse.Namespace) -> None:
    await _check_robot(store, asked)
    segments, size = 0, 0
    with ProgressBar(sys.stderr) as bar:
        async for names in find_covered(store, deletion):
            segments += len(names)
            size += sum(each.size for each in names)
            bar.show_text(f"{write_count(segments, 'segment')} found")
    found = _write_sum(segments, size) if segments else "the store has no matching segments"
    _confirm(asked.yes, f"{what}: {found}.")
    is_ordered = True
    try:
        await put_tombstone(store, deletion)  # even without a match: relays may have it in memory
    except ArchiveRefused as e:
        if str(e) != NO_SPACE:
            raise
        is_ordered = False  # the deletion itself frees the space this needs
    with ProgressBar(sys.stderr) as bar:

        def show(erased: Erased) -> None:
            bar.show_progress(erased.segments, segments, "segments deleted")

        erased = await erase(store, deletion, show)
    if not is_ordered:
        await _order_late(store, deletion, erased)
    if erased.segments:
        print(f"deleted: {_write_sum(erased.segments, erased.bytes)}. {LATER}")
    else:
        print(f"{what}: the store had no matching segments. {LATER}")


async def _order_late(store: ObjectStore, deletion: Deletion, erased: Erased) -> None:
    try:
        await put_tombstone(store, deletion)
    except ArchiveError as e:
        raise CommandFailed(
            f"deleted {write_count(erased.segments, 'segment')} from the store, but could not tell relays to "
            f"delete them from memory ({e}): free some space and run the command again"
        ) from None


async def _check_robot(store: ObjectStore, asked: argparse.Namespace) -> None:
    """Raise CommandFailed when neither the store nor the relay on this machine has the robot."""
    there = [name for name in await store.list_folders("") if name != TOMBSTONES]
    if asked.robot in there or _has_in_memory(asked):
        return
    robots = f"only {', '.join(there):.200}" if there else "nor any other robot"
    raise CommandFailed(
        f"the store has no robot {asked.robot!r}, {robots}; nothing was deleted. If the robot is only in a "
        "relay's memory, also give that relay's socket (--past-socket PATH)"
    )


def _has_in_memory(asked: argparse.Namespace) -> bool:
    try:
        rows = ask_relay(asked.past_socket, {"do": "list"}).get("rows")
    except RelayAway:
        return False
    return isinstance(rows, list) and any(isinstance(row, list) and row[:1] == [asked.robot] for row in rows)


def _read_span(asked: argparse.Namespace, now_ms: int) -> tuple[int, int]:
    if asked.all:
        if asked.from_ms is not None or asked.to_ms is not None:
            raise SettingsError("give --all or --from and --to, not both")
        return 0, now_ms
    if asked.from_ms is None or asked.to_ms is None:
        raise SettingsError("give --from and --to, or --all")
    if asked.from_ms >= asked.to_ms:
        raise SettingsError("--from is not before --to")
    if asked.from_ms >= now_ms:
        raise SettingsError("--from is in the future")
    return asked.from_ms, asked.to_ms


def _write_sum(segments: int, size: int) -> str:
    return f"{write_count(segments, 'segment')}, {write_count(size, 'byte')}"


def _describe(deletion: Deletion, is_all: bool) -> str:
    view = "each view" if deletion.view is None else f"view {deletion.view}"
    span = "everything until now" if is_all else write_span(deletion.from_ms, deletion.to_ms)
    return f"{deletion.robot}, {view}, {span}"


def _confirm(is_sure: bool, what: str) -> None:
    if is_sure:
        return
    if not sys.stdin.isatty():
        raise SettingsError("can't ask for confirmation without a terminal: give --yes")
    sys.stderr.write(f"{what}\nDelete it? This can't be undone. [y/N] ")
    sys.stderr.flush()
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        raise CommandFailed("nothing was deleted")
