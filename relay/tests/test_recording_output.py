"""An export is there whole or not at all, whatever happens while it is made."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from posecast_relay.recording.output import OutputError, check_place, open_place

RECORDING = '{"format":"posecast-recording","version":1}'
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
    assert refusal(tmp_path / "lecture") == "is there already; --replace puts a new one there"
    make_folder(tmp_path / "lecture", RECORDING + " ", replace=True)
    assert (tmp_path / "lecture/recording.json").read_text() == RECORDING + " "

    (tmp_path / "photos").mkdir()
    (tmp_path / "photos/1.jpg").write_text("x")
    (tmp_path / "notes.csv").write_text("a,b\n")
    (tmp_path / "x.posecast").write_text("x")
    (tmp_path / "x.mcap").write_text("x")
    (tmp_path / "link").symlink_to("lecture")
    (tmp_path / "other").mkdir()
    (tmp_path / "other/recording.json").write_text("{}")
    for name in ("photos", "notes.csv", "x.posecast", "x.mcap", "link", "other"):
        assert refusal(tmp_path / name, replace=True) == "is no earlier export, and stays as it is"
    assert (tmp_path / "photos/1.jpg").read_text() == "x"


def test_files_of_ours_are_known(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("\ufefftime,seconds\r\n")
    (tmp_path / "x.mcap").write_bytes(b"\x89MCAP0\r\n")
    with zipfile.ZipFile(tmp_path / "x.posecast", "w") as packed:
        packed.writestr("recording.json", RECORDING)
    for name in ("x.csv", "x.mcap", "x.posecast"):
        check_place(tmp_path / name, True)


def start_writer(target: Path) -> subprocess.Popen[str]:
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(target)], stdout=subprocess.PIPE, text=True)
    assert writer.stdout is not None
    assert writer.stdout.readline() == "writes\n"
    return writer


def test_two_at_once_and_one_that_is_killed(tmp_path: Path) -> None:
    make_folder(tmp_path / "lecture")
    writer = start_writer(tmp_path / "lecture")
    assert refusal(tmp_path / "lecture", replace=True) == "another process is just writing it"
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    assert (tmp_path / "lecture/recording.json").read_text() == RECORDING
    make_folder(tmp_path / "lecture", RECORDING + "\n", replace=True)
    assert list_names(tmp_path) == ["lecture"]
    assert (tmp_path / "lecture/recording.json").read_text() == RECORDING + "\n"


def test_what_was_being_replaced_by_one_that_was_killed_comes_back(tmp_path: Path) -> None:
    make_folder(tmp_path / "lecture")
    (tmp_path / ".lecture.part").mkdir()
    (tmp_path / "lecture").rename(tmp_path / ".lecture.part/old")
    assert refusal(tmp_path / "lecture") == "is there already; --replace puts a new one there"
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
