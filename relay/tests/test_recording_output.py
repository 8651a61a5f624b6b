"""An export is there whole or not at all, whatever happens while it is made."""

from __future__ import annotations

import os
import random
import resource
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer
from posecast_relay.recording.output import (
    PAGE_FILES,
    PAGE_FOLDERS,
    OutputError,
    check_place,
    open_place,
    pack_recording,
)
from posecast_relay.recording.page import add_page
from posecast_wire import Quantiser, Schema
from posecast_wire.recording import PastRecording, RecordedSegment, encode_recording

from wire.python.benches.bytes_per_frame import SHARED, rows

from .past_doors import PAGE_MS, make_kept
from .recording_stage import KeptModel, KeptSource, collect, list_files
from .taped_world import TapedWorld, on_air
from .test_recording_collector import record

FROM_MS = 1_795_000_000_000
SEGMENT = RecordedSegment(7, 9, 0, FROM_MS, FROM_MS + 1000, 0, 0, 0, 100, None, None, 0)
RECORDING = encode_recording(
    PastRecording(
        robot="r",
        view="public",
        from_ms=FROM_MS,
        to_ms=FROM_MS + 1000,
        segments=(SEGMENT,),
        schemas={},
        models=(),
        notes=(),
    )
).decode()
CSV = "\ufefftime,seconds,robot_time,a\r\n"
WRITER = """
import sys, time
from pathlib import Path
from posecast_relay.recording.output import open_place
with open_place(Path(sys.argv[1]), True) as place:
    place.mkdir()
    (place / "recording.json").write_text("half")
    print("writes", flush=True)
    time.sleep(60)
"""


def make_folder(target: Path, text: str = RECORDING, replace: bool = False) -> None:
    with open_place(target, replace) as place:
        place.mkdir()
        (place / "recording.json").write_text(text)


def refusal(target: Path, replace: bool = False) -> str:
    with pytest.raises(OutputError) as caught:
        make_folder(target, replace=replace)
    said = str(caught.value)
    assert said.startswith(f"{target}: ")
    return said.removeprefix(f"{target}: ")


def list_names(folder: Path) -> list[str]:
    return sorted(os.listdir(folder))


def test_it_comes_whole_and_nothing_else_is_left(tmp_path: Path) -> None:
    make_folder(tmp_path / "lecture")
    with open_place(tmp_path / "x.csv", False) as place:
        place.write_text("\ufefftime,")
    assert list_names(tmp_path) == ["lecture", "x.csv"]
    assert (tmp_path / "lecture/recording.json").read_text() == RECORDING


def break_off(target: Path, error: BaseException) -> None:
    with open_place(target, True) as place:
        place.mkdir()
        (place / "half").write_text("half")
        raise error


@pytest.mark.parametrize(
    "error", [RuntimeError("x"), KeyboardInterrupt(), OSError(28, "No space left on device")]
)
def test_what_breaks_off_leaves_nothing(tmp_path: Path, error: BaseException) -> None:
    make_folder(tmp_path / "lecture")
    for name in ("lecture", "new"):
        with pytest.raises(type(error) if not isinstance(error, OSError) else OutputError) as caught:
            break_off(tmp_path / name, error)
        if isinstance(error, OSError):
            assert str(caught.value) == f"{tmp_path}/{name}: no space left on device; nothing of it is left"
    assert list_names(tmp_path) == ["lecture"]
    assert (tmp_path / "lecture/recording.json").read_text() == RECORDING


def test_what_is_there_stays_unless_it_is_to_be_replaced_and_is_an_export(tmp_path: Path) -> None:
    assert refusal(tmp_path / "no/where") == f"there is no folder {tmp_path}/no"
    make_folder(tmp_path / "lecture")
    assert refusal(tmp_path / "lecture") == "already exists; give --replace to replace it"
    make_folder(tmp_path / "lecture", RECORDING + " ", replace=True)
    assert (tmp_path / "lecture/recording.json").read_text() == RECORDING + " "

    for name, text in FOREIGN_FILES.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos/1.jpg").write_text("x")
    (tmp_path / "link").symlink_to("lecture")
    (tmp_path / "c.csv").write_text(CSV)
    (tmp_path / "link.csv").symlink_to("c.csv")
    (tmp_path / "ten").mkdir()
    (tmp_path / "ten/recording.json").write_text("0123456789")
    for name in ("photos", "link", "link.csv", "ten", *FOREIGN_FILES):
        assert refusal(tmp_path / name, replace=True) == "is not an earlier export, and is left as it is"
    assert (tmp_path / "photos/1.jpg").read_text() == "x"
    for name, text in FOREIGN_FILES.items():
        assert (tmp_path / name).read_text() == text


FOREIGN_FILES = {
    "notes.csv": "a,b\n",
    "times.csv": "\ufefftime,place\n",
    "x.posecast": "x",
    "x.mcap": "x",
    "plain": RECORDING,
}


@pytest.mark.parametrize(
    ("name", "text"),
    [("CNAME", "uni.example"), ("lecture-notes.md", "mine"), (".git/HEAD", "ref"), ("keys", "")],
)
def test_an_export_with_somebodys_own_files_in_it_stays(tmp_path: Path, name: str, text: str) -> None:
    make_folder(tmp_path / "h2")
    (tmp_path / "h2" / name).parent.mkdir(exist_ok=True)
    (tmp_path / "h2" / name).write_text(text)
    shown = name.partition("/")[0]
    assert refusal(tmp_path / "h2", replace=True) == (
        f"holds {shown}, which no export wrote: move it away or name another folder"
    )
    assert (tmp_path / "h2" / name).read_text() == text
    assert (tmp_path / "h2/recording.json").read_text() == RECORDING
    assert list_names(tmp_path) == ["h2"]


def test_a_link_in_an_export_is_somebodys_own(tmp_path: Path) -> None:
    make_folder(tmp_path / "h2")
    (tmp_path / "h2/recording.json").rename(tmp_path / "kept.json")
    (tmp_path / "h2/recording.json").symlink_to("../kept.json")
    assert refusal(tmp_path / "h2", replace=True).startswith("holds recording.json, which no export wrote")
    (tmp_path / "h2/recording.json").unlink()
    (tmp_path / "h2/recording.json").write_text(RECORDING)
    (tmp_path / "h2/models").symlink_to("..")
    assert refusal(tmp_path / "h2", replace=True).startswith("holds models, which no export wrote")


def write_beside(target: Path, replace: bool) -> None:
    with open_place(target, replace) as place:
        place.write_text(CSV)
        target.write_text("mine")


def test_what_comes_to_lie_there_meanwhile_stays(tmp_path: Path) -> None:
    for name, replace in (("lecture", True), ("x.csv", False)):
        with pytest.raises(OutputError):
            write_beside(tmp_path / name, replace)
        assert (tmp_path / name).read_text() == "mine"
    assert list_names(tmp_path) == ["lecture", "x.csv"]


def test_all_that_an_export_has_is_known(tmp_path: Path) -> None:
    make_folder(tmp_path / "lecture")
    for name in ("segments", "keys", "models", *PAGE_FOLDERS):
        (tmp_path / "lecture" / name).mkdir()
    for name in PAGE_FILES:
        (tmp_path / "lecture" / name).touch()
    check_place(tmp_path / "lecture", True)


def test_files_of_ours_are_known(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text(CSV)
    with (tmp_path / "x.mcap").open("wb") as file:
        Writer(file).start(profile="ros2", library="posecast")
    with zipfile.ZipFile(tmp_path / "x.posecast", "w") as packed:
        packed.writestr("recording.json", RECORDING)
        packed.writestr("models/a/manifest.json", "{}")
    for name in ("x.csv", "x.mcap", "x.posecast"):
        check_place(tmp_path / name, True)
    with zipfile.ZipFile(tmp_path / "x.posecast", "a") as packed:
        packed.writestr("notes.md", "mine")
    with (tmp_path / "x.mcap").open("wb") as file:
        Writer(file).start(profile="ros2", library="rosbag2")
    for name in ("x.mcap", "x.posecast"):
        assert refusal(tmp_path / name, replace=True) == "is not an earlier export, and is left as it is"


def test_the_hidden_folder_is_nobody_elses(tmp_path: Path) -> None:
    (tmp_path / ".lecture.part").mkdir()
    (tmp_path / ".lecture.part/mine").touch()
    make_folder(tmp_path / "lecture")
    assert list_names(tmp_path) == [".lecture.part", "lecture"]
    assert list_names(tmp_path / ".lecture.part") == ["mine"]
    beside = tmp_path / ".new.posecast-part"
    beside.mkdir()
    (beside / "mine").touch()
    (beside / "made").mkdir()
    assert refusal(tmp_path / "new") == (
        ".new.posecast-part beside it holds mine, which no export wrote: move it away"
    )
    assert list_names(beside) == ["made", "mine"]
    beside.rename(tmp_path / "elsewhere")
    beside.symlink_to("elsewhere")
    assert refusal(tmp_path / "new") == (
        ".new.posecast-part beside it is not the folder of an export: move it away"
    )
    assert list_names(tmp_path / "elsewhere") == ["made", "mine"]


def start_writer(target: Path) -> subprocess.Popen[str]:
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(target)], stdout=subprocess.PIPE, text=True)
    assert writer.stdout is not None
    assert writer.stdout.readline() == "writes\n"
    return writer


def test_two_at_once_and_one_that_is_killed(tmp_path: Path) -> None:
    make_folder(tmp_path / "lecture")
    writer = start_writer(tmp_path / "lecture")
    assert refusal(tmp_path / "lecture", replace=True) == "another process is writing it"
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    assert (tmp_path / "lecture/recording.json").read_text() == RECORDING
    make_folder(tmp_path / "lecture", RECORDING + "\n", replace=True)
    assert list_names(tmp_path) == ["lecture"]
    assert (tmp_path / "lecture/recording.json").read_text() == RECORDING + "\n"


def test_what_was_being_replaced_by_one_that_was_killed_comes_back(tmp_path: Path) -> None:
    make_folder(tmp_path / "lecture")
    (tmp_path / ".lecture.posecast-part").mkdir()
    (tmp_path / "lecture").rename(tmp_path / ".lecture.posecast-part/old")
    assert refusal(tmp_path / "lecture") == "already exists; give --replace to replace it"
    assert list_names(tmp_path) == ["lecture"]


def test_a_file_that_may_not_grow_is_a_full_disk(tmp_path: Path) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
    try:
        with pytest.raises(OutputError) as caught, open_place(tmp_path / "x.csv", False) as place:
            place.write_bytes(bytes(20_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert str(caught.value) == f"{tmp_path}/x.csv: file too large; nothing of it is left"
    assert list_names(tmp_path) == []


def test_an_empty_folder_is_taken(tmp_path: Path) -> None:
    target = tmp_path / "lecture"
    target.mkdir()
    check_place(target, replace=False)
    with open_place(target, replace=False) as place:
        place.mkdir()
        (place / "a").touch()
    assert [path.name for path in tmp_path.rglob("*")] == ["lecture", "a"]
    with pytest.raises(OutputError, match="already exists"):
        check_place(target, replace=False)


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


REPOSITORY = Path(__file__).resolve().parents[2]
BUILT_PAGE = Path(os.environ.get("POSECAST_PAGE", REPOSITORY / "spa/dist"))
HZ, MINUTES = 30, 50
KEY_EVERY = 4 * HZ
MODEL_BYTES = 2_000_000
ALLOWED_BYTES = 12_000_000


@pytest.mark.full
@pytest.mark.skipif(not (SHARED / "telemetry").exists(), reason="no telemetry sets beside the repository")
@pytest.mark.skipif(not (BUILT_PAGE / "index.html").exists(), reason="no built page: run make setup")
def test_fifty_minutes_fit_into_twelve_megabytes(tmp_path: Path) -> None:
    schema = Schema.parse((SHARED / "telemetry/schema.json").read_text())
    _, values = rows(schema, SHARED / "telemetry/mixed.npz")
    quantiser = Quantiser(schema)
    codes = [quantiser.quantise(sample) for sample in values]
    model = KeptModel({"high.glb": (random.Random(1).randbytes(MODEL_BYTES), "model/gltf-binary")})
    world = TapedWorld()
    edge = on_air(world, schema)
    world.hear_event(edge, type="model", hash=model.name)
    for n in range(HZ * 60 * MINUTES):
        world.pass_time(1 / HZ)
        world.hear(edge, edge.frame(world.now, codes[n % len(codes)], force_key=n % KEY_EVERY == 0))
    recording, found = collect(KeptSource(world.close(), [model]), tmp_path / "lecture", packs=True)
    assert found.lost == []
    add_page(BUILT_PAGE, tmp_path / "lecture", recording, None)
    sizes = {path: (tmp_path / "lecture" / path).stat().st_size for path in list_files(tmp_path / "lecture")}
    sums = {
        part: sum(size for path, size in sizes.items() if path.startswith(part))
        for part in ("segments", "keys", "models", "recording.json", "")
    }
    frames = sum(each.frames for each in recording.segments)
    print(f"{frames} frames, {len(recording.segments)} segments:", sums)
    assert frames >= HZ * 60 * MINUTES
    assert np.mean([each.frames for each in recording.segments[1:-1]]) == KEY_EVERY
    assert sums[""] <= ALLOWED_BYTES
