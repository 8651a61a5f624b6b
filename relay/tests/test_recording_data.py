"""data.csv and data.mcap beside the page of an exported folder."""

from __future__ import annotations

import asyncio
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from posecast_relay.archive.store import open_object_store
from posecast_relay.config.settings import SettingsError
from posecast_relay.export.span import ExportedSpan, RecordingFolder
from posecast_relay.past_command.convert import run_convert
from posecast_relay.past_command.main import run_past
from posecast_relay.recording import data_files
from posecast_relay.recording.output import check_place
from posecast_relay.recording.page import add_page

from .recording_stage import KeptSource, collect, make_page
from .test_past_export_span import list_frames_ms, write_iso
from .test_recording_collector import record
from .test_recording_page import tags
from .test_recording_store_source import fill

Export = Callable[..., str]
KEPT = record(30.0)
SPAN = ("--from", "2026-01-01", "--to", "2099-01-01")
FRAMES_MS = list_frames_ms(KEPT)


@pytest.fixture
def export(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Export:
    """Exports a part of a past to the folder `lecture`; what standard error says, without its path."""
    asyncio.run(fill(open_object_store(f"file://{tmp_path}/store"), KEPT))
    make_page(tmp_path / "page")

    def run(*arguments: str) -> str:
        span = ["--from", write_iso(FRAMES_MS[200]), "--to", write_iso(FRAMES_MS[500])]
        where = ["--past", f"file://{tmp_path}/store", "--page", str(tmp_path / "page")]
        run_past(["export", "--robot", "r", *span, *where, "-o", str(tmp_path / "lecture"), *arguments], {})
        return capsys.readouterr().err.replace(f"posecast-relay: {tmp_path}/lecture: ", "")

    return run


def offered(folder: Path) -> str | None:
    return tags((folder / "index.html").read_text()).get("posecast-data")


def test_a_folder_has_what_its_page_plays_as_a_table_and_as_messages(tmp_path: Path, export: Export) -> None:
    assert export() == ""
    lecture = tmp_path / "lecture"
    sizes = {name: (lecture / name).stat().st_size for name in ("data.csv", "data.mcap")}
    assert offered(lecture) == f"data.csv {sizes['data.csv']} data.mcap {sizes['data.mcap']}"
    assert "posecast-data" not in (lecture / "embed/index.html").read_text()
    rows = (lecture / "data.csv").read_bytes().count(b"\r\n") - 1
    assert rows > 301  # the whole segments of a span of 301 frames
    for kind in ("csv", "mcap"):
        run_convert([str(lecture), str(tmp_path / f"x.{kind}")])
        assert (lecture / f"data.{kind}").read_bytes() == (tmp_path / f"x.{kind}").read_bytes()
    check_place(lecture, replace=True)
    assert export("--replace") == ""


def test_none_are_written_where_none_are_wanted(tmp_path: Path, export: Export) -> None:
    assert export("--data-max", "0") == ""
    assert not list((tmp_path / "lecture").glob("data.*"))
    assert offered(tmp_path / "lecture") is None


def test_a_large_one_is_left_out_and_named(
    tmp_path: Path, export: Export, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(data_files, "MEGABYTE", 17_000)  # a table has more, messages are compressed
    assert export("--data-max", "1") == "data.csv: left out: over 1 MB; --data-max allows more\n"
    assert offered(tmp_path / "lecture") == f"data.mcap {(tmp_path / 'lecture/data.mcap').stat().st_size}"
    assert not (tmp_path / "lecture/data.csv").exists()


def test_without_the_extra_there_are_no_messages(
    tmp_path: Path, export: Export, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    said = export()
    assert re.match(r"data\.mcap: left out: MCAP: not installed; (uv )?pip install ", said)
    assert said.count("\n") == 1
    assert [path.name for path in (tmp_path / "lecture").glob("data.*")] == ["data.csv"]


def test_a_span_without_frames_has_none(tmp_path: Path) -> None:
    recording, _ = collect(KeptSource(KEPT[:1]), tmp_path / "to")
    span = ExportedSpan(RecordingFolder(tmp_path / "to"), recording, recording.to_ms + 1, recording.to_ms + 2)
    data = data_files.write_data_files(tmp_path / "to", span, 100)
    assert data.warnings == [f"data.{kind}: left out: there are no frames" for kind in ("csv", "mcap")]
    add_page(make_page(tmp_path / "page"), tmp_path / "to", recording, None, data.sizes)
    assert offered(tmp_path / "to") is None


@pytest.mark.parametrize("given", ["-1", "1e3", "", "1000000"])
def test_a_limit_is_a_whole_number(export: Export, given: str) -> None:
    with pytest.raises(SettingsError) as caught:
        export("--data-max", given)
    assert str(caught.value) == "argument --data-max: use a whole number from 0 to 999999"


def test_a_file_has_no_page_and_so_no_data_beside_it() -> None:
    with pytest.raises(SettingsError) as caught:
        run_past(["export", "--robot", "r", *SPAN, "-o", "x.posecast", "--data-max", "5"], {})
    assert str(caught.value) == "--data-max: only works for a folder; a .posecast file has no page"
