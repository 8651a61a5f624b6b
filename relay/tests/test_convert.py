"""`posecast convert`: recordings of every shape, and files that only look like one."""

from __future__ import annotations

import asyncio
import io
import json
import os
import re
import resource
import shutil
import struct
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from posecast_relay.archive.models import make_model_key
from posecast_relay.archive.store import open_object_store
from posecast_relay.config.settings import SettingsError
from posecast_relay.export import span
from posecast_relay.past.segment import KeptSegment
from posecast_relay.past_command import convert
from posecast_relay.past_command.common import write_moment
from posecast_relay.past_command.convert import run_convert
from posecast_relay.past_command.main import run_past
from posecast_relay.recording.output import pack_recording
from posecast_wire.recording import PastRecording, segment_path

from .export_stage import messages_of
from .recording_stage import KeptModel, KeptSource, collect
from .test_past_export_span import list_frames_ms, write_iso
from .test_recording_collector import record
from .test_recording_store_source import fill

TREE = {
    "links": ["trunk", "arm"],
    "visuals": [],
    "joints": [{"name": "j", "type": "fixed", "parent": 0, "child": 1}],
}
FORMATS = ("mcap", "csv")
MEMORY_BYTES = 600 << 20  # of address space, of which the libraries take most
PATIENCE_S = 60.0


class Saved:
    """A recording in each of its shapes: a file, a folder with packed segments, and a ZIP of that."""

    def __init__(self, folder: Path, kept: list[KeptSegment], models: list[KeptModel]) -> None:
        self.folder = folder
        self.kept, self.models = kept, models
        self.recording, _ = collect(KeptSource(kept, models), folder / "plain")
        pack_recording(folder / "plain", self.recording, folder / "walk.posecast")
        collect(KeptSource(kept, models), folder / "lecture", packs=True)
        with zipfile.ZipFile(folder / "lecture.zip", "w", zipfile.ZIP_DEFLATED) as packed:
            for path in sorted((folder / "lecture").rglob("*")):
                packed.write(path, path.relative_to(folder))
        self.shapes = ("walk.posecast", "lecture", "lecture.zip")

    def repack(self, name: str, change: Callable[[str, bytes], bytes | None]) -> Path:
        """Another file, of what `change` makes of each entry."""
        with (
            zipfile.ZipFile(self.folder / "walk.posecast") as old,
            zipfile.ZipFile(self.folder / name, "w") as new,
        ):
            for path in old.namelist():
                data = change(path, old.read(path))
                if data is not None:
                    new.writestr(path, data)
        return self.folder / name


def change_at(place: str, change: Callable[[bytes], bytes | None], path: str, data: bytes) -> bytes | None:
    return change(data) if path == place else data


def pick(other: bytes, _: bytes) -> bytes:
    return other


@pytest.fixture
def saved(tmp_path: Path) -> Saved:
    model = KeptModel({"low.glb": (b"glTF", "model/gltf-binary")}, **TREE)
    return Saved(tmp_path, record(30.0, model.name), [model])


def export(saved: Saved, out: Path, from_ms: int, to_ms: int) -> None:
    """What `past export` makes of the same past, as it was archived."""
    store = open_object_store(f"file://{saved.folder}/store")
    asyncio.run(fill(store, saved.kept))
    for model in saved.models:
        for name, data in {"manifest.json": model.manifest, **model.files}.items():
            asyncio.run(store.put(make_model_key("r", model.name, name), data))
    span = ["--from", write_iso(from_ms), "--to", write_iso(to_ms)]
    run_past(["export", "--robot", "r", *span, "--past", f"file://{saved.folder}/store", "-o", str(out)], {})


def is_same(one: Path, other: Path) -> bool:
    """Message by message, with the names of topics and types, or byte for byte."""
    if one.suffix == ".csv":
        return one.read_bytes() == other.read_bytes()
    found, wanted = (list(messages_of(path.read_bytes())) for path in (one, other))
    assert len(found) > 100
    return found == wanted


@pytest.mark.parametrize("kind", FORMATS)
def test_a_recording_gives_what_the_relay_exports(
    saved: Saved, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = saved.recording
    export(saved, saved.folder / f"relay.{kind}", recording.from_ms, recording.to_ms)
    exported = capsys.readouterr().out.replace(f"{saved.folder}/relay.{kind}", "")
    for i, shape in enumerate(saved.shapes):
        out = saved.folder / f"{i}.{kind}"
        run_convert([str(saved.folder / shape), str(out)])
        said = capsys.readouterr()
        assert (said.out.replace(str(out), ""), said.err) == (exported, "")
        assert is_same(out, saved.folder / f"relay.{kind}")


def test_the_model_poses_the_links(saved: Saved) -> None:
    run_convert([str(saved.folder / "walk.posecast"), str(saved.folder / "x.mcap")])
    topics = {topic for topic, *_ in messages_of((saved.folder / "x.mcap").read_bytes())}
    assert {"/joint_states", "/tf", "/rosout"} <= topics


@pytest.mark.parametrize("kind", FORMATS)
def test_a_part_of_it_is_exactly_that_part(
    saved: Saved, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    from_ms = list_frames_ms(saved.kept)[100]
    to_ms = from_ms + 7000
    export(saved, saved.folder / f"relay.{kind}", from_ms, to_ms)
    out = saved.folder / f"x.{kind}"
    span = ["--from", write_iso(from_ms), "--to", write_iso(to_ms)]
    run_convert([str(saved.folder / "walk.posecast"), str(out), *span])
    assert f": r/public, 0:00:07 from {write_moment(from_ms)}, 21" in capsys.readouterr().out
    assert is_same(out, saved.folder / f"relay.{kind}")
    run_convert([str(saved.folder / "walk.posecast"), str(out), "--from", span[1], "--replace"])
    assert ": r/public, 0:00:2" in capsys.readouterr().out


def test_a_part_that_is_missing_or_another_is_told_and_the_rest_is_there(
    saved: Saved, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [segment_path(each.take, each.index) for each in saved.recording.segments]
    frames = sum(each.frames for each in saved.recording.segments)
    with zipfile.ZipFile(saved.folder / "walk.posecast") as packed:
        first = packed.read(paths[0])
    changes: dict[str, Callable[[bytes], bytes | None]] = {
        "missing": lambda _: None,
        r"byte \d+: cut short|no end: cut short or damaged": lambda data: data[:-40],
        "is of r/public, take [0-9a-f]{16}, index 0": lambda _: first,
        "version 9, made by a newer Posecast": lambda data: data[:4] + b"\x09" + data[5:],
        "gzip: damaged": lambda _: b"\x1f\x8b" + bytes(40),
        r"over \d+ bytes": lambda data: data + bytes(4 << 20),
    }
    for says, change in changes.items():
        wrong = saved.repack("wrong.posecast", partial(change_at, paths[2], change))
        run_convert([str(wrong), str(saved.folder / "x.csv"), "--replace"])
        said = capsys.readouterr()
        passed, gap = said.err.splitlines()
        assert passed.startswith(
            f"posecast: {saved.folder}/x.csv: passed over 1 segment; the first: {paths[2]}: "
        )
        assert re.search(says, passed), passed
        assert "there is nothing for 0:00:0" in gap
        assert f", {frames - saved.recording.segments[2].frames} frames, " in said.out


def run_refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The line of a command that ends with status 2."""
    with pytest.raises(SettingsError) as caught:
        run_convert([str(each) for each in arguments])
    assert capsys.readouterr().out == ""
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_one_line_for_all_that_is_wrong(
    saved: Saved, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good, out = tmp_path / "walk.posecast", tmp_path / "x.mcap"
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.posecast").write_text("a,b\n")
    (tmp_path / "cut.posecast").write_bytes(good.read_bytes()[:-30])
    (tmp_path / "hollow.posecast").touch()
    os.mkfifo(tmp_path / "pipe")
    newer = json.dumps({"format": "posecast-recording", "version": 2}).encode()
    as_index = {"newer.posecast": newer, "torn.posecast": b'{"format":', "other.posecast": b"{}"}
    for name, index in as_index.items():
        saved.repack(name, partial(change_at, "recording.json", partial(pick, index)))
    saved.repack("photos.zip", lambda path, data: None if path == "recording.json" else data)
    saved.repack("shell.posecast", lambda path, data: data if path == "recording.json" else None)
    before = sorted(os.listdir(tmp_path))
    wrong: list[tuple[list[object], str]] = [
        ([tmp_path / "none.posecast", out], f"{tmp_path}/none.posecast: no such file or directory"),
        ([tmp_path / "empty", out], f"{tmp_path}/empty: no recording: it has no recording.json"),
        ([tmp_path / "photos.zip", out], f"{tmp_path}/photos.zip: no recording: it has no recording.json"),
        ([tmp_path / "pipe", out], f"{tmp_path}/pipe: neither a file nor a folder"),
        ([tmp_path / "text.posecast", out], "text.posecast: not a .posecast file, or cut short"),
        ([tmp_path / "hollow.posecast", out], "hollow.posecast: the file is empty"),
        ([tmp_path / "cut.posecast", out], "cut.posecast: not a .posecast file, or cut short"),
        ([tmp_path / "newer.posecast", out], "newer.posecast: version: made by a newer Posecast"),
        ([tmp_path / "torn.posecast", out], "torn.posecast: recording: not JSON"),
        ([tmp_path / "other.posecast", out], "other.posecast: format: must be posecast-recording"),
        (
            [tmp_path / "shell.posecast", out],
            "shell.posecast: no frames in this span; passed over 15 segments; the first: segments/",
        ),
        ([good, tmp_path / "x.bag"], "argument OUT: name a file that ends in .csv or .mcap"),
        ([good, tmp_path / "x"], "argument OUT: name a file that ends in .csv or .mcap"),
        ([good], "the following arguments are required: OUT"),
        ([good, out, "--from", "25:00"], "argument --from: '25:00': use"),
        ([good, out, "--from", "2026-01-02", "--to", "2026-01-01"], "--from is not before --to"),
        ([good, out, "--to", "2001-01-01"], "walk.posecast: the recording is from "),
    ]
    for arguments, says in wrong:
        assert says in run_refused(capsys, *arguments), arguments
    assert sorted(os.listdir(tmp_path)) == before


def test_what_cannot_be_written_is_status_one_and_leaves_nothing(
    saved: Saved, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    good = tmp_path / "walk.posecast"
    (tmp_path / "x.csv").write_text("mine")
    before = sorted(os.listdir(tmp_path))

    def fail(*arguments: object) -> str:
        with pytest.raises(SystemExit) as caught:
            run_convert([str(each) for each in arguments])
        said = capsys.readouterr()
        assert (caught.value.code, said.out, said.err.count("\n")) == (1, "", 1)
        return said.err

    assert fail(good, tmp_path / "x.csv") == (
        f"posecast: {tmp_path}/x.csv: already exists; give --replace to replace it\n"
    )
    assert "is not an earlier export" in fail(good, tmp_path / "x.csv", "--replace")
    (tmp_path / "folder.csv").mkdir()
    assert fail(good, tmp_path / "folder.csv") == f"posecast: {tmp_path}/folder.csv: is a directory\n"
    (tmp_path / "folder.csv").rmdir()
    assert fail(good, "/no/x.csv") == "posecast: /no/x.csv: there is no folder /no\n"

    def be_interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(convert, "write_table_file", be_interrupted)
    assert "x.mcap: interrupted; no files were left behind\n" in fail(good, tmp_path / "x.mcap")
    assert (tmp_path / "x.csv").read_text() == "mine"
    assert sorted(os.listdir(tmp_path)) == before


def limit_disk() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))


def limit_memory() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))


def test_a_disk_that_fills_up_leaves_nothing(saved: Saved, tmp_path: Path) -> None:
    before = sorted(os.listdir(tmp_path))
    command = [sys.executable, "-m", "posecast_relay.cli", "convert"]
    command += [str(tmp_path / "walk.posecast"), str(tmp_path / "x.csv")]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=120, check=False, preexec_fn=limit_disk
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"posecast-relay: {tmp_path}/x.csv: file too large; nothing of it is left\n"
    assert sorted(os.listdir(tmp_path)) == before


def zeros(count: int) -> bytes:
    """The deflated form of so many zeros, whole MiB, without having them."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    block = packer.compress(bytes(1 << 20)) + packer.flush(zlib.Z_FULL_FLUSH)  # may be repeated
    return block * (count >> 20) + packer.flush()


def zip_of(entries: dict[str, tuple[bytes, int, int, int]], share: bool = False) -> bytes:
    """A ZIP of entries by name: their packed bytes, method, size and CRC, none of which has to be true.
    `share`: all of them stand at the same place."""
    out, listing = io.BytesIO(), io.BytesIO()
    at = 0
    for i, (name, (data, method, size, crc)) in enumerate(entries.items()):
        path = name.encode()
        common = struct.pack("<HHHHHIIIHH", 20, 0, method, 0, 33, crc, len(data), size, len(path), 0)
        if not share or i == 0:
            at = out.tell()
            out.write(b"PK\3\4" + common + path + data)
        listing.write(
            b"PK\1\2" + struct.pack("<H", 20) + common + struct.pack("<HHHII", 0, 0, 0, 0, at) + path
        )
    end = struct.pack("<HHHHIIH", 0, 0, *(len(entries),) * 2, listing.tell(), out.tell(), 0)
    return out.getvalue() + listing.getvalue() + b"PK\5\6" + end


def index_of(recording: PastRecording, folder: Path) -> tuple[bytes, int, int, int]:
    """The entry of `recording.json`."""
    data = (folder / "plain/recording.json").read_bytes()
    assert recording.segments
    return data, 0, len(data), zlib.crc32(data)


GIGABYTE = 1 << 30
CONVERT_EACH = """
import sys
from posecast_relay.config.settings import SettingsError
from posecast_relay.past_command.convert import run_convert
for file in sys.argv[2:]:
    try:
        run_convert([file, sys.argv[1]])
    except SettingsError as e:
        print(e)
"""


def test_a_gigabyte_in_a_small_zip_is_refused_without_unpacking_it(saved: Saved, tmp_path: Path) -> None:
    packed = zeros(GIGABYTE)
    assert len(packed) < 2_000_000
    assert sum(len(zlib.decompressobj(-15).decompress(packed, 1 << 20)) for _ in range(2)) == 2 << 20
    index = index_of(saved.recording, tmp_path)
    segments = [segment_path(each.take, each.index) for each in saved.recording.segments]
    bombs: dict[str, tuple[bytes, str]] = {
        "its index, as it says": (
            zip_of({"recording.json": (packed, 8, GIGABYTE, 0)}),
            "recording.json: over 33554432 bytes",
        ),
        "its index, which says less": (
            zip_of({"recording.json": (packed, 8, 1000, 0)}),
            "recording.json: damaged or cut short",
        ),
        "every segment, as they say": (
            zip_of({"recording.json": index} | dict.fromkeys(segments, (packed, 8, GIGABYTE, 0))),
            "no frames in this span; passed over 15 segments; the first: ",
        ),
        "every segment, which say less": (
            zip_of({"recording.json": index} | dict.fromkeys(segments, (packed, 8, 3000000, 0))),
            "no frames in this span; passed over 15 segments; the first: ",
        ),
        "many entries that share it": (
            zip_of({f"{i}": (packed, 8, 1000, 0) for i in range(1000)}, share=True),
            "its entries overlap",
        ),
        "a list without an end": (
            zip_of({f"{i:0>60000}": (b"", 0, 0, 0) for i in range(700)}),
            "its list of entries has over 40000000 bytes",
        ),
        "a method that takes memory": (
            zip_of({"recording.json": (bytes(9) + packed[:1000], 14, 1000, 0)}),
            "recording.json: compressed in a way that no recording is",
        ),
    }
    for name, (data, _) in bombs.items():
        (tmp_path / f"{name}.posecast").write_bytes(data)
    files = [str(tmp_path / f"{name}.posecast") for name in bombs]
    command = [sys.executable, "-c", CONVERT_EACH, str(tmp_path / "x.mcap"), *files]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE_S, check=True, preexec_fn=limit_memory
    )
    lines = done.stdout.splitlines()
    assert len(lines) == len(bombs), (done.stdout, done.stderr)
    for line, file, (_, says) in zip(lines, files, bombs.values(), strict=True):
        assert line.startswith(f"{file}: {says}"), line
    assert not list(tmp_path.glob("*x.mcap*"))


def test_more_entries_than_any_recording_has_are_refused(
    saved: Saved, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(span, "ENTRIES_MAX", 10)
    assert re.search(
        r"walk\.posecast: \d\d entries, 10 allowed$",
        run_refused(capsys, saved.folder / "walk.posecast", saved.folder / "x.csv"),
    )


def test_a_segments_gzip_is_unpacked_up_to_the_largest_segment(
    saved: Saved, capsys: pytest.CaptureFixture[str]
) -> None:
    bomb = b"\x1f\x8b\x08\0\0\0\0\0\0\x03" + zeros(64 << 20) + bytes(8)
    wrong = saved.repack("gzip.posecast", lambda path, data: bomb if path.startswith("segments/") else data)
    assert "the first: segments/" in (said := run_refused(capsys, wrong, saved.folder / "x.csv"))
    assert "gzip: over " in said


def test_links_out_of_a_folder_and_pipes_in_it_hold_nothing_up(
    saved: Saved, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [segment_path(each.take, each.index) for each in saved.recording.segments]
    shutil.copytree(tmp_path / "plain", tmp_path / "odd")
    for path, make in ((paths[1], os.mkfifo), (paths[3], lambda place: place.symlink_to("/dev/zero"))):
        (tmp_path / "odd" / path).unlink()
        make(tmp_path / "odd" / path)
    run_convert([str(tmp_path / "odd"), str(tmp_path / "x.csv")])
    assert "passed over 2 segments; the first: " in capsys.readouterr().err
