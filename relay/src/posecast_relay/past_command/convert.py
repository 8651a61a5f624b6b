"""`posecast convert`: writes a recording that lies in files as a table or as messages."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from posecast_wire.command_line.parser import CommandParser
from posecast_wire.command_line.progress_bar import ProgressBar
from posecast_wire.recording import RECORDING_FILE, PastRecording, RecordingError, decode_recording
from posecast_wire.recording.contents import RECORDING_BYTES_MAX

from posecast_relay.config.settings import SettingsError, SettingsParser
from posecast_relay.export.span import (
    WRITERS,
    ExportedSpan,
    FileUnreadable,
    RecordingFiles,
    open_recording_files,
)
from posecast_relay.past_command.common import read_end, read_start, write_moment
from posecast_relay.past_command.export import (
    WRITING_FAILED,
    WrittenExport,
    catch_sigterm,
    tell_written,
    write_table_file,
)
from posecast_relay.recording.collector import NothingThere
from posecast_relay.recording.output import check_place, open_place

HELP = "convert a recording (.posecast or an exported folder) to .mcap or .csv"
STATUSES = {0: "success", 1: "OUT could not be written", 2: "wrong arguments, or no such recording in FILE"}


def make_convert_parser(program: str = "posecast") -> CommandParser:
    """Make the command's parser. `program` is its name in messages."""
    parser = SettingsParser(
        prog=f"{program} convert", description=HELP, allow_abbrev=False, statuses=STATUSES
    )
    add = parser.add_argument
    told = "a .posecast file, an exported folder, or the ZIP of one"
    add("file", metavar="FILE", type=Path, help=told)
    add("out", metavar="OUT", type=_read_out, help="OUT.mcap: messages of ROS 2; OUT.csv: a table")
    for flag, what, read in (("from", "start", read_start), ("to", "end", read_end)):
        told = f"{what} of the span to convert: 2026-11-22T14:20 or 14:20 [all of it]"
        add(f"--{flag}", dest=f"{flag}_ms", metavar="T", type=read, help=told)
    add("--replace", action="store_true", help="replace an earlier export at OUT")
    return parser


def run_convert(argv: Sequence[str], program: str = "posecast") -> None:
    """Convert a recording. `program` is its name in messages.

    Raises SettingsError with a one-line message for wrong arguments and a FILE that can't be converted, and
    SystemExit 1 if OUT can't be written.
    """
    asked = make_convert_parser(program).parse_args(argv)
    catch_sigterm()
    try:
        check_place(asked.out, asked.replace)
        with open_recording_files(asked.file) as files:
            recording = _read_recording(files)
            span = _choose_span(asked, files, recording)
            written, size = _write(asked, span)
        tell_written(program, asked.out, span, written, size)
    except (FileUnreadable, RecordingError, NothingThere) as e:
        raise SettingsError(f"{asked.file}: {e}") from None
    except WRITING_FAILED as e:
        print(f"{program}: {e}", file=sys.stderr)
        raise SystemExit(1) from None
    except KeyboardInterrupt:
        print(f"{program}: {asked.out}: interrupted; no files were left behind", file=sys.stderr)
        raise SystemExit(1) from None


def _read_recording(files: RecordingFiles) -> PastRecording:
    try:
        data = files.read(RECORDING_FILE, RECORDING_BYTES_MAX)
    except FileUnreadable as e:
        raise FileUnreadable(f"{RECORDING_FILE}: {e}") from None
    if data is None:
        raise FileUnreadable(f"no recording: it has no {RECORDING_FILE}")
    return decode_recording(data)


def _choose_span(asked: argparse.Namespace, files: RecordingFiles, recording: PastRecording) -> ExportedSpan:
    from_ms = recording.from_ms if asked.from_ms is None else asked.from_ms
    to_ms = recording.to_ms if asked.to_ms is None else asked.to_ms
    if asked.from_ms is not None and asked.to_ms is not None and from_ms >= to_ms:
        raise SettingsError("--from is not before --to")
    if from_ms > recording.to_ms or to_ms < recording.from_ms:
        whole = f"{write_moment(recording.from_ms)} to {write_moment(recording.to_ms)}"
        raise SettingsError(f"{asked.file}: the recording is from {whole}: choose --from and --to within it")
    return ExportedSpan(files, recording, from_ms, to_ms)


def _write(asked: argparse.Namespace, span: ExportedSpan) -> tuple[WrittenExport, int]:
    """Write the file; also return its size in bytes."""
    with open_place(asked.out, asked.replace) as place, ProgressBar(sys.stderr) as bar:
        report = partial(bar.show_progress, what=str(asked.out))
        return write_table_file(asked.out, replace(span, report=report), place), place.stat().st_size


def _read_out(text: str) -> Path:
    path = Path(text)
    if path.suffix not in WRITERS:
        raise argparse.ArgumentTypeError(f"name a file that ends in {' or '.join(WRITERS)}")
    return path
