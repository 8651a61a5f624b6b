"""What docs/how-to/record says of CSV and MCAP is so: its examples run, its tables are whole."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from posecast_relay.export import mcap_file
from posecast_relay.export.csv_file import COLUMNS_MAX, FIRST_COLUMNS
from posecast_relay.export.ros_messages import IMU, JOINT_STATE, LOG, NUMBERS, TRANSFORMS, WRENCH
from posecast_wire import Schema

from .export_cases import BALANCE_COLUMNS
from .export_stage import Take, csv_of, mcap_of

ROOT = Path(__file__).resolve().parents[2]
CSV, MCAP = ((ROOT / f"docs/how-to/record/{page}.md").read_text() for page in ("csv", "mcap"))
COMMAND = (ROOT / "docs/reference/past-export.md").read_text()
UV = ROOT / ".tools" / "bin" / "uv"
DEMO = (ROOT / "wire" / "vectors" / "segments" / "schema.json").read_text()


def example(name: str) -> str:
    """The block of Python that begins with its file's name."""
    (found,) = re.findall(rf"```python\n(# {re.escape(name)}\n.*?)```", CSV + MCAP, re.DOTALL)
    return str(found)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where some seconds of the demo robot's lie."""
    schema = Schema.parse(DEMO)
    row = [3.0 if f.bits else 0.25 for f in schema.fields for _ in f.labels]
    take = Take(DEMO)
    segments = take.record(take.encode([row] * 40))
    (tmp_path / "walk.csv").write_bytes(("\ufeff" + csv_of(segments, DEMO)[0]).encode())
    (tmp_path / "walk.mcap").write_bytes(mcap_of(segments, DEMO)[0])
    return tmp_path


def test_the_example_with_mcap_runs(folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", example("tilt.py")], cwd=folder, capture_output=True, text=True, check=False
    )
    assert re.fullmatch(r"1795357261\.412: \d+ joints, knee at 0\.250 rad\n", done.stdout), done.stderr


@pytest.mark.full
def test_the_example_with_pandas_runs(folder: Path) -> None:
    uv = str(UV if UV.exists() else shutil.which("uv"))
    made = (uv, "run", "--no-project", "--python", sys.executable, "--with", "pandas==3.1.1", "python", "-c")
    if subprocess.run([*made, "import pandas"], capture_output=True, check=False).returncode:
        pytest.skip("pandas can't be installed here")
    done = subprocess.run(
        [*made, example("walk.py")], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.stdout.startswith("40 frames from 14:21:00, knee from 0.250 to 0.250 rad\n"), done.stderr
    assert done.stdout.endswith("enabled: 100%\n")


def test_the_columns_are_those_of_the_file(folder: Path) -> None:
    header = (folder / "walk.csv").read_text(encoding="utf-8-sig").split("\n")[0]
    for column in FIRST_COLUMNS:
        assert f"| `{column}` |" in CSV
    for column in ("pos.LKN [rad]", "ftf.RF.fz [N]"):
        assert column in header.split(",")
        assert f"`{column}`" in CSV
    assert f"More than {COLUMNS_MAX:,} columns" in CSV


def test_the_columns_of_balance_are_those_of_the_page() -> None:
    table = CSV[CSV.index("### Balance") :]
    for column in BALANCE_COLUMNS:
        name, axis = re.sub(r"\.([xyz]) \[", " [", column), re.search(r"\.([xyz]) \[", column)
        if axis is None:
            assert f"| `{column}` |" in table
        else:
            row = next(line for line in table.split("\n") if f"`{name.replace(' [', '.x [')}`" in line)
            assert axis[1] == "x" or f"`.{axis[1]}`" in row


def test_the_topics_are_those_of_the_file() -> None:
    rows = re.findall(r"^\| `(/\S+)` \| `(\S+)` \|", MCAP, re.MULTILINE)
    assert rows == [
        ("/joint_states", JOINT_STATE),
        ("/joint_references", JOINT_STATE),
        ("/imu/SITE", IMU),
        ("/wrench/SITE", WRENCH),
        ("/tf", TRANSFORMS),
        ("/rosout", LOG),
        ("/posecast/FIELD", NUMBERS),
    ]


def test_the_sizes_are_those_in_force() -> None:
    assert f"each {mcap_file.CHUNK_BYTES >> 20} MiB of messages" in COMMAND
    assert f"`{mcap_file.WORLD[1]}`" in MCAP
