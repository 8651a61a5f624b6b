"""`posecast-relay past export`: writes a time span of the past as files for a static host or other
programs."""

from __future__ import annotations

import argparse
import asyncio
import re
import signal
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from posecast_wire.checked import is_unicode, make_visible
from posecast_wire.command_line.progress_bar import ProgressBar
from posecast_wire.recording import PastRecording, RecordingError
from posecast_wire.recording.contents import TITLE_CHARACTERS_MAX
from posecast_wire.recording.reader import CONTROLS

from posecast_relay.config.settings import SettingsError, find_page
from posecast_relay.core.policy import PUBLIC, Audience
from posecast_relay.export.csv_file import TooManyColumnsError
from posecast_relay.export.mcap_file import McapMissingError, TooManyTopicsError
from posecast_relay.export.span import WRITERS, ExportedSpan, RecordingFolder, write_table
from posecast_relay.export.table import GAP_MS, HeldTime
from posecast_relay.kit import write_count
from posecast_relay.past.segment import PAGE_MS
from posecast_relay.past_command.common import (
    CommandFailed,
    open_store,
    read_end,
    read_name,
    read_start,
    write_length,
    write_moment,
)
from posecast_relay.recording.collector import Collection, Collector, Description, NothingThere
from posecast_relay.recording.data_files import DATA_MAX_MB, write_data_files
from posecast_relay.recording.http_source import HttpSource
from posecast_relay.recording.notes import NotesError, place_notes, read_notes
from posecast_relay.recording.output import OutputError, check_place, open_place, pack_recording
from posecast_relay.recording.page import add_page, check_page, unpacks_segments
from posecast_relay.recording.source import PastUnreadable, RecordingSource
from posecast_relay.recording.store_source import StoreSource

HELP = "export a time span of the past: a folder that plays in a browser, .posecast, .csv or .mcap"
RELAY = "http://127.0.0.1:8080"
FILES = (".posecast", *WRITERS)
FOREIGN = frozenset(  # formats we can't write; without this list they would become folder names
    [
        ".avi",
        ".bag",
        ".db3",
        ".gif",
        ".gz",
        ".html",
        ".json",
        ".mkv",
        ".mov",
        ".mp4",
        ".parquet",
        ".tar",
        ".tgz",
        ".txt",
        ".webm",
        ".xlsx",
        ".zip",
    ]
)
OF_A_FOLDER = ("page", "url", "data_max")  # flags that a file has no use for
TOKEN_BYTES_MAX = 16_384
TOKEN = re.compile(r"[!-~]+")
WRITING_FAILED = (OutputError, McapMissingError, TooManyColumnsError, TooManyTopicsError)
URL = re.compile(r"https?://(?:(?![?#])[!-~])+")


def add_arguments(parser: argparse.ArgumentParser, environ: Mapping[str, str]) -> None:
    """Add the arguments of the command."""
    add = parser.add_argument
    add("--robot", metavar="ID", type=read_name, required=True, help="the robot")
    add("--view", metavar="VIEW", type=read_name, help="the view to export [the view that viewers get]")
    for flag, what, read in (("from", "start", read_start), ("to", "end", read_end)):
        told = (
            f"{what} of the time span: 2026-11-22T14:20 with or without a zone, or 14:20 for today; extended "
            "to whole segments"
        )
        add(f"--{flag}", dest=f"{flag}_ms", metavar="T", type=read, required=True, help=told)
    told = "a .posecast, .csv or .mcap file, or a folder for any static host"
    add("-o", "--out", dest="out", metavar="PATH", type=_read_out, required=True, help=told)
    add("--replace", action="store_true", help="replace an earlier export at OUT")
    add("--relay", metavar="URL", help=f"export from a running relay [{RELAY}]")
    add(
        "--past",
        metavar="URL",
        default=None,
        help="export from a store: the relay's --past URL [POSECAST_PAST]",
    )
    told = "anyone, signed-in or link: export what this audience could see [anyone]"
    add("--as", dest="audience", choices=[each.value for each in Audience], metavar="WHO", help=told)
    add(
        "--token-file",
        metavar="FILE",
        type=Path,
        help="relay only: file with the token of a viewer who may see it",
    )
    for flag, told in (
        ("--title", "title of the recording"),
        ("--author", "who made it"),
        ("--licence", "the licence under which others may use it"),
    ):
        add(flag, metavar="TEXT", type=_read_heading, help=told)
    add("--notes", metavar="FILE", type=Path, help="a TOML file with notes at points in time")
    add("--page", metavar="DIR", type=Path, help="folder only: the built page [as for the relay]")
    add(
        "--url",
        metavar="URL",
        type=_read_url,
        help="folder only: the URL you will publish it at; chats need it to show a preview picture",
    )
    told = (
        "folder only: largest size of data.csv and of data.mcap beside the page, in MB; 0: neither of them "
        f"[{DATA_MAX_MB}]"
    )
    add("--data-max", metavar="MB", type=_read_megabytes, help=told)
    parser.set_defaults(stored=environ.get("POSECAST_PAST"))


def run(asked: argparse.Namespace) -> None:
    """Export a time span of the past. Raises SettingsError, ArchiveError, CommandFailed."""
    if asked.from_ms >= asked.to_ms:
        raise SettingsError("--from is not before --to")
    catch_sigterm()
    try:
        notes = [] if asked.notes is None else read_notes(asked.notes)
        about = Description(asked.title, asked.author, asked.licence, partial(place_notes, notes))
        page = _find_page(asked)
        check_place(asked.out, asked.replace)
        _export(asked, _open_source(asked), about, page)
    except NotesError as e:
        raise SettingsError(f"--notes {e}") from None
    except (PastUnreadable, NothingThere, RecordingError, *WRITING_FAILED) as e:
        raise CommandFailed(str(e)) from None
    except KeyboardInterrupt:
        raise CommandFailed(f"{asked.out}: interrupted; no files were left behind") from None


def catch_sigterm() -> None:
    """Turn SIGTERM into KeyboardInterrupt, so that partial files are removed."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)


def _export(
    asked: argparse.Namespace, source: RecordingSource, about: Description, page: Path | None
) -> None:
    with open_place(asked.out, asked.replace) as place:
        folder = place if page is not None else place.with_name("collected")
        folder.mkdir()
        collector = Collector(source, folder, packs=page is not None and unpacks_segments(page))
        collecting = _collect_and_close(collector, asked, source, about)
        try:
            recording = asyncio.run(collecting)
        except asyncio.CancelledError:
            raise KeyboardInterrupt from None
        finally:
            collecting.close()  # if the loop ended before running it, Python would warn on stderr
            catch_sigterm()  # the loop restored the default handler when it ended
        with ProgressBar(sys.stderr) as bar:
            report = partial(bar.show_progress, what=str(asked.out))
            span = ExportedSpan(RecordingFolder(folder), recording, asked.from_ms, asked.to_ms, report)
            written = _write(asked, span, folder, place, page)
        size = _measure(place)
    tell_written(asked.program, asked.out, span, written, size, _tell_lost(collector.found))


def tell_written(
    program: str, out: Path, span: ExportedSpan, written: WrittenExport, size: int, lost: Sequence[str] = ()
) -> None:
    """Print what was written, and a line for each thing that is missing."""
    for line in (*lost, *written.warnings, *_tell_lacks(written.held, span)):
        print(f"{program}: {out}: {line}", file=sys.stderr)
    held, recording = written.held, span.recording
    print(
        f"{out}: {recording.robot}/{recording.view}, {write_length(held.to_ms - held.from_ms)} from "
        f"{write_moment(held.from_ms)}, {written.what}, {size:,} bytes"
    )


async def _collect_and_close(
    collector: Collector, asked: argparse.Namespace, source: RecordingSource, about: Description
) -> PastRecording:
    try:
        return await _collect(collector, asked, source, about)
    finally:
        await source.close()


async def _collect(
    collector: Collector, asked: argparse.Namespace, source: RecordingSource, about: Description
) -> PastRecording:
    task = asyncio.current_task()
    assert task is not None
    for signal_ in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(signal_, task.cancel)
    there = await source.find_span()  # from a relay, this also returns the view's name
    with ProgressBar(sys.stderr) as bar:
        collector.report_to(partial(_show_collected, bar))
        try:
            if there is None:
                raise NothingThere("nothing was recorded in this span")
            # data is being recorded while this runs: include no segment that begins later than this
            to_ms = min(asked.to_ms, there.to_ms + PAGE_MS)
            return await collector.collect(max(asked.from_ms, there.from_ms), to_ms, about)
        except NothingThere as e:
            span = f"from {write_moment(asked.from_ms)} to {write_moment(asked.to_ms)}"
            what = "no recording at all"
            if there is not None:
                what = f"a recording from {write_moment(there.from_ms)} to {write_moment(there.to_ms)}"
            raise NothingThere(f"{source.robot}/{source.view}, {span}: {e}; it has {what}") from None


def _show_collected(bar: ProgressBar, found: Collection) -> None:
    waits = f"waiting for {make_visible(found.awaited)}"
    if found.total:
        bar.show_progress(found.done, found.total, what=f"segments, {found.size / 1e6:.1f} MB, {waits}")
    else:
        bar.show_text(waits)


class WrittenExport(NamedTuple):
    """What was written (`what`), the time it covers, and one line for each thing that was left out."""

    what: str
    held: HeldTime
    warnings: Sequence[str] = ()


def _write(
    asked: argparse.Namespace, span: ExportedSpan, folder: Path, place: Path, page: Path | None
) -> WrittenExport:
    """Write the export in the requested format. `folder`: where the recording was collected."""
    recording = span.recording
    if page is not None:
        # the page plays whole segments, so the data are of those, too
        whole = replace(span, from_ms=recording.from_ms, to_ms=recording.to_ms)
        data = write_data_files(place, whole, DATA_MAX_MB if asked.data_max is None else asked.data_max)
        add_page(page, place, recording, asked.url, data.sizes)
        return _sum_segments(recording)._replace(warnings=data.warnings)
    if asked.out.suffix == ".posecast":
        pack_recording(folder, recording, place, span.report)
        return _sum_segments(recording)
    try:
        return write_table_file(asked.out, span, place)
    except NothingThere as e:
        raise NothingThere(f"{asked.out}: {e}") from None


def write_table_file(out: Path, span: ExportedSpan, place: Path) -> WrittenExport:
    """Write a span as a table or as messages, by the suffix of `out`, to `place`. Raises NothingThere,
    OSError, and the errors of WRITING_FAILED."""
    with place.open("wb") as file:
        table = write_table(file, out.suffix, span)
    if not table.frames:
        raise NothingThere("; ".join(("no frames in this span", *table.warnings)))
    return WrittenExport(write_count(table.frames, "frame"), table.held, table.warnings)


def _sum_segments(recording: PastRecording) -> WrittenExport:
    held = HeldTime()
    for each in [each for each in recording.segments if each.frames] or recording.segments:
        held.add(each.from_ms, each.to_ms)
    return WrittenExport(write_count(len(recording.segments), "segment"), held)


def _open_source(asked: argparse.Namespace) -> HttpSource | StoreSource:
    """Open the relay or store to export from. Raises SettingsError, PastUnreadable."""
    past = asked.past if asked.past is not None or asked.relay is not None else asked.stored
    if asked.relay is not None and past is not None:
        raise SettingsError("give --relay or --past, not both")
    audience = None if asked.audience is None else Audience(asked.audience)
    if past in (None, "", "0", "memory:"):
        if asked.token_file is None and audience not in (None, Audience.ANYONE):
            raise SettingsError(
                f"--as {audience}: the relay needs the token of such a viewer: give --token-file FILE"
            )
        if asked.token_file is not None and audience in (None, Audience.ANYONE):
            raise SettingsError(
                "--token-file: everyone who gets this export can see what the token may see: "
                "confirm it with --as signed-in or --as link"
            )
        token = None if asked.token_file is None else _read_token(asked.token_file)
        return HttpSource(asked.relay or RELAY, asked.robot, asked.view, token)
    if asked.token_file is not None:
        raise SettingsError("--token-file: only works with a relay; a store uses its own keys")
    store = open_store(argparse.Namespace(**vars(asked) | {"past": past}))
    assert store is not None  # no memory
    return StoreSource(store, asked.robot, asked.view or PUBLIC, audience or Audience.ANYONE)


def _find_page(asked: argparse.Namespace) -> Path | None:
    """Find the built page for a folder export. Raises SettingsError, OutputError."""
    if asked.out.suffix in FILES:
        for name in OF_A_FOLDER:
            if getattr(asked, name) is not None:
                raise SettingsError(
                    f"--{name.replace('_', '-')}: only works for a folder; "
                    f"a {asked.out.suffix} file has no page"
                )
        if asked.out.suffix != ".posecast" and asked.notes is not None:
            raise SettingsError(f"--notes: a {asked.out.suffix} file can't hold notes")
        return None
    found = asked.page or find_page()
    if found is None:
        raise SettingsError("this package contains no built page: give its folder with --page DIR")
    check_page(found)
    return found


def _tell_lost(found: Collection) -> list[str]:
    """Return one line for each thing that could not be exported."""
    more = found.lost_count - len(found.lost)
    return [*found.lost, *([f"and {more:,} more like these"] if more else [])]


def _tell_lacks(held: HeldTime, span: ExportedSpan) -> list[str]:
    """Describe in one line the parts of the requested span that are missing; return no line if it is
    complete."""
    lacks: list[str] = []
    if held.from_ms - span.from_ms > GAP_MS:
        lacks.append(f"before {write_moment(held.from_ms)}")
    if span.to_ms - held.to_ms > GAP_MS:
        lacks.append(f"after {write_moment(held.to_ms)}")
    if held.gaps:
        of = "" if held.gaps == 1 else f" in {held.gaps:,} gaps, the first"
        lacks.append(f"for {write_length(held.gaps_ms)}{of} from {write_moment(held.gap_from_ms)}")
    return [f"there is nothing {', nothing '.join(lacks)}"] if lacks else []


def _measure(place: Path) -> int:
    if place.is_file():
        return place.stat().st_size
    return sum(path.stat().st_size for path in place.rglob("*") if path.is_file())


def _read_token(file: Path) -> str:
    try:
        with file.open("rb") as opened:
            raw = opened.read(TOKEN_BYTES_MAX + 1)
    except OSError as e:
        raise SettingsError(f"--token-file {file}: {(e.strerror or str(e)).lower()}") from None
    token = raw.decode("latin-1").strip()
    if len(raw) > TOKEN_BYTES_MAX or not TOKEN.fullmatch(token):
        raise SettingsError(f"--token-file {file}: contains no token; a token is one line without spaces")
    return token


def _read_megabytes(text: str) -> int:
    if not re.fullmatch(r"[0-9]{1,6}", text, re.ASCII):
        raise argparse.ArgumentTypeError("use a whole number from 0 to 999999")
    return int(text)


def _read_heading(text: str) -> str:
    if not 0 < len(text) <= TITLE_CHARACTERS_MAX or CONTROLS.search(text) or not is_unicode(text):
        raise argparse.ArgumentTypeError(f"use 1 to {TITLE_CHARACTERS_MAX} characters in one line")
    return text


def _read_out(text: str) -> Path:
    path = Path(text)
    if path.name in ("", ".."):
        raise argparse.ArgumentTypeError("name a new folder or file")
    if path.suffix.lower() in FOREIGN or (path.suffix not in FILES and path.suffix.lower() in FILES):
        raise argparse.ArgumentTypeError(f"use {', '.join(FILES)}, or the name of a folder")
    return path


def _read_url(text: str) -> str:
    if not URL.fullmatch(text):
        raise argparse.ArgumentTypeError("use https://HOST/PATH, without ? and #")
    return text
