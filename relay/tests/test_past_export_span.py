"""What `posecast-relay past export` says of the span that was asked for: what of it is there, what not."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from posecast_relay.archive.store import open_object_store
from posecast_relay.export.table import HeldTime
from posecast_relay.past.segment import KeptSegment
from posecast_relay.past_command.common import write_moment, write_moment_utc
from posecast_relay.past_command.main import run_past
from posecast_wire.command_line.progress_bar import ProgressBar
from posecast_wire.segment import decode_segment

from .recording_stage import make_page
from .test_recording_collector import record
from .test_recording_store_source import fill

Export = Callable[..., tuple[str, str]]
FILES = ("x.csv", "x.mcap", "x.posecast", "lecture")
TABLES = FILES[:2]


def write_iso(unix_ms: int) -> str:
    """In UTC with milliseconds."""
    return write_moment_utc(unix_ms).replace("Z", f".{unix_ms % 1000:03}Z")


def list_frames_ms(kept: Sequence[KeptSegment]) -> list[int]:
    """When each frame was accepted, unix ms."""
    found = [decode_segment(each.data) for each in kept]
    return [each.start.from_ms + frame.at_us // 1000 for each in found for frame in each.frames]


@pytest.fixture
def export(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Export:
    """Exports what is given from a store; the lines of standard output and error, without the path."""
    page = make_page(tmp_path / "page")
    monkeypatch.setattr("posecast_relay.past_command.export.find_page", lambda: page)
    places = iter(range(100))

    def run(out: str, kept: Sequence[KeptSegment], from_ms: int, to_ms: int) -> tuple[str, str]:
        folder = tmp_path / str(next(places))
        folder.mkdir()
        asyncio.run(fill(open_object_store(f"file://{folder}/store"), kept))
        span = ["--from", write_iso(from_ms), "--to", write_iso(to_ms)]
        where = ["--past", f"file://{folder}/store", "-o", str(folder / out)]
        run_past(["export", "--robot", "r", *span, *where], {})
        said = capsys.readouterr()
        return tuple(text.replace(f"{folder}/", "").rstrip("\n") for text in said)  # type: ignore[return-value]

    return run


@pytest.mark.parametrize("out", FILES[:3])
def test_collecting_and_writing_show_how_far_they_are(
    export: Export, out: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[tuple[int, int, str]] = []
    monkeypatch.setattr(ProgressBar, "show_progress", lambda _, *told, what: shown.append((*told, what)))
    kept = record(40.0)
    export(out, kept, kept[0].from_ms, kept[-1].to_ms)
    collected = [each for each in shown if " MB, waiting for " in each[2]]
    assert max(collected)[:2] == (len(kept), len(kept))
    written = [each for each in shown if each[2].endswith(f"/{out}")]
    files = len(kept) if out in TABLES else written[0][1]
    assert [each[:2] for each in written] == [(done, files) for done in range(1, files + 1)]
    assert files >= len(kept) > 3


@pytest.mark.parametrize("out", TABLES)
def test_a_table_has_exactly_the_span_and_says_so(export: Export, out: str) -> None:
    kept = record(40.0)
    from_ms = list_frames_ms(kept)[200]
    told, lacks = export(out, kept, from_ms, from_ms + 20_000)
    assert told.startswith(f"{out}: r/public, 0:00:20 from {write_moment(from_ms)}, 60")
    assert lacks == ""


@pytest.mark.parametrize("out", FILES)
def test_a_span_beyond_what_there_is_is_told_in_one_line(export: Export, out: str) -> None:
    kept = record(40.0)
    frames = list_frames_ms(kept)
    first_ms, last_ms = frames[0], frames[-1]
    with_frames = [each for each in kept if each.frames]
    if out not in TABLES:
        first_ms, last_ms = with_frames[0].from_ms, with_frames[-1].to_ms
    told, lacks = export(out, kept, first_ms - 60_000, last_ms + 3_600_000)
    assert told.startswith(f"{out}: r/public, 0:00:4")
    assert f" from {write_moment(first_ms)}, " in told
    before, after = f"before {write_moment(first_ms)}", f"after {write_moment(last_ms)}"
    assert lacks == f"posecast-relay: {out}: there is nothing {before}, nothing {after}"
    assert export(out, kept, first_ms - 1000, last_ms + 1000)[1] == ""
    only = export(out, kept, first_ms - 60_000, last_ms)[1]
    assert only == f"posecast-relay: {out}: there is nothing {before}"
    only = export(out, kept, first_ms, last_ms + 60_000)[1]
    assert only == f"posecast-relay: {out}: there is nothing {after}"


@pytest.mark.parametrize("out", FILES)
def test_a_gap_is_told_in_that_line(export: Export, out: str) -> None:
    whole = [each for each in record(60.0) if each.frames]
    kept = [*whole[:4], *whole[9:]]
    gap_ms = whole[3].to_ms if out not in TABLES else list_frames_ms(whole[:4])[-1]
    at = write_moment(gap_ms)
    assert export(out, kept, kept[0].from_ms, kept[-1].to_ms)[1] == (
        f"posecast-relay: {out}: there is nothing for 0:00:10 from {at}"
    )
    two = [*kept[:-4], *kept[-2:]]
    assert export(out, two, two[0].from_ms - 60_000, two[-1].to_ms)[1] == (
        f"posecast-relay: {out}: there is nothing before {write_moment(two[0].from_ms)}, "
        f"nothing for 0:00:14 in 2 gaps, the first from {at}"
    )


def test_a_pause_of_two_seconds_is_no_gap() -> None:
    held = HeldTime()
    for from_ms, to_ms in ((1000, 1500), (3500, 3500), (3000, 3100), (5500, 5600)):
        held.add(from_ms, to_ms)
    assert held == HeldTime(1000, 5600)
    held.add(7601, 7700)
    held.add(9800, 9900)
    assert held == HeldTime(1000, 9900, 2, 4101, 5600)
