"""A recording as one file: what Python's zipfile reads in it, and the same bytes every time."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import pytest
from posecast_relay.recording.output import pack_recording

from .past_doors import PAGE_MS, make_kept
from .recording_stage import KeptModel, KeptSource, collect, list_files
from .test_recording_collector import record

MODEL = KeptModel({"a.glb": (os.urandom(5000), "model/gltf-binary"), "b.stl": (bytes(5000), "model/stl")})


def test_it_holds_the_folder_with_the_index_first(tmp_path: Path) -> None:
    recording, _ = collect(KeptSource(record(20.0, MODEL.name), [MODEL]), tmp_path / "to")
    pack_recording(tmp_path / "to", recording, tmp_path / "one.posecast")
    with zipfile.ZipFile(tmp_path / "one.posecast") as packed:
        assert packed.testzip() is None
        names = packed.namelist()
        assert sorted(names) == list_files(tmp_path / "to")
        assert names[0] == "recording.json"
        segments = [name for name in names if name.startswith("segments/")]
        assert [int(name.split("/")[2].split(".")[0]) for name in segments] == [*range(len(segments))]
        for name in names:
            assert packed.read(name) == (tmp_path / "to" / name).read_bytes()
        kinds = {name.rpartition(".")[2]: packed.getinfo(name).compress_type for name in names}
    assert kinds["glb"] == zipfile.ZIP_STORED
    assert kinds["stl"] == kinds["json"] == kinds["segment"] == zipfile.ZIP_DEFLATED


def test_it_is_the_same_every_time(tmp_path: Path) -> None:
    kept = record(6.0, MODEL.name)
    for name in ("a", "b"):
        recording, _ = collect(KeptSource(kept, [MODEL]), tmp_path / name)
        for path in (tmp_path / name).rglob("*"):
            os.utime(path, (1e9, 1e9) if name == "a" else None)
        pack_recording(tmp_path / name, recording, tmp_path / f"{name}.posecast")
    assert (tmp_path / "a.posecast").read_bytes() == (tmp_path / "b.posecast").read_bytes()


@pytest.mark.full
def test_more_entries_than_a_plain_zip_counts(tmp_path: Path) -> None:
    kept = [make_kept(i, PAGE_MS + 5 * i, events=()) for i in range(66_000)]
    recording, _ = collect(KeptSource(kept), tmp_path / "to")
    pack_recording(tmp_path / "to", recording, tmp_path / "one.posecast")
    with zipfile.ZipFile(tmp_path / "one.posecast") as packed:
        assert len(packed.namelist()) > 66_000
        assert packed.read(packed.namelist()[66_000]) == kept[65_999].data
