"""The gallery reports the result for each robot in a folder, including those that can't be built."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tools.gallery.child import run_measured
from tools.gallery.files import find_robots, list_packages

ROOT = Path(__file__).resolve().parent.parent
RED = '<material name="m"><color rgba="1 0 0 1"/></material>'
BOX = f'<visual><geometry><box size="0.2 0.2 0.2"/></geometry>{RED}</visual>'
WHOLE = f"""<robot name="arm"><link name="base">{BOX}</link><link name="arm">{BOX}</link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 1"/>
<axis xyz="0 0 2"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
BROKEN = '<robot name="arm">\n<link'
PART = '<mujoco><worldbody><body name="finger"><joint/></body></worldbody></mujoco>'
MAIN = '<mujoco><include file="finger.xml"/><worldbody><body><joint/></body></worldbody></mujoco>'


def run_gallery(*arguments: Path | str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tools.gallery", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=200, check=False)


def test_each_robot_has_a_row_and_a_picture(tmp_path: Path) -> None:
    folder, out = tmp_path / "robots", tmp_path / "out"
    folder.mkdir()
    (folder / "broken.urdf").write_text(BROKEN)
    (folder / "whole.urdf").write_text(WHOLE)
    (folder / "package.xml").write_text("<package/>")
    ended = run_gallery("--out", out, folder)
    assert ended.returncode == 0, ended.stderr
    with (out / "table.csv").open(newline="") as file:
        broken, whole = csv.DictReader(file)
    assert (broken["status"], broken["name"], broken["links"]) == ("refused", "robots/broken.urdf", "0")
    assert broken["line"] == "2: not XML: unclosed token"
    assert (whole["status"], whole["format"]) == ("built", "urdf")
    assert [int(whole[k]) for k in ("links", "joints", "visuals", "stand_ins", "errors")] == [2, 1, 2, 0, 0]
    assert 20 < float(whole["rss_mb"]) < 300
    assert float(whole["cpu_s"]) > 0
    assert whole["worst_mm"] == "0.0000" or "pinocchio" in whole["line"]
    assert (out / "findings.txt").read_text().startswith("warning\taxis-length\trobots/whole.urdf:")
    assert "2 files: " in ended.stdout
    assert "refused: robots/broken.urdf: 2: not XML" in ended.stdout
    with Image.open(out / "sheet-1.png") as sheet:
        drawn = np.array(sheet.convert("RGB")).astype(int)
    red = (drawn[..., 0] > 120) & (drawn[..., 1] < 40) & (drawn[..., 2] < 40)
    assert red[:, drawn.shape[1] // 6 :].sum() > 2000, "two boxes, seen twice, in the second place"


def test_installed_packages_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that has a module, and one that a wheel of cmeel keeps in share/ with no module beside it."""
    walkers = tmp_path / "dm_control"
    robots = tmp_path / "cmeel.prefix/share/example-robot-data"
    for folder in (walkers, robots, robots / "random_urdfs"):
        folder.mkdir(parents=True)
        (folder / "whole.urdf").write_text(WHOLE)
    monkeypatch.setattr("sysconfig.get_path", lambda _: str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert list_packages() == [robots, walkers]
    assert [robot.name for robot in find_robots(list_packages())] == [
        "example-robot-data/whole.urdf",
        "dm_control/whole.urdf",
    ]


def test_nothing_found_is_said(tmp_path: Path) -> None:
    ended = run_gallery("--out", tmp_path / "out", tmp_path)
    assert ended.returncode == 1
    assert ended.stderr == f"gallery: no robot found ({tmp_path}); pass folders: make gallery FOLDERS=…\n"


def test_a_file_counts_once_and_knows_who_includes_it(tmp_path: Path) -> None:
    for name, text in {"finger.xml": PART, "hand.xml": MAIN, "still.xml": "<mujoco/>"}.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "again.xml").symlink_to(tmp_path / "hand.xml")
    found = {robot.path.resolve().name: robot.is_included for robot in find_robots([tmp_path, tmp_path])}
    assert found == {"finger.xml": True, "hand.xml": False}


def test_what_takes_too_long_is_stopped() -> None:
    ended = run_measured([sys.executable, "-c", "while True: pass"], limit_s=1.0)
    assert ended.status is None
    assert ended.cpu_s > 0


def test_a_file_that_is_named_itself_keeps_its_folder_in_its_name(tmp_path: Path) -> None:
    (tmp_path / "panda").mkdir()
    (tmp_path / "panda/robot.xml").write_text(PART)
    (found,) = find_robots([tmp_path / "panda/robot.xml"])
    assert found.name == "panda/robot.xml"
