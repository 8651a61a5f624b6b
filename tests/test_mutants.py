"""The table of `make mutants` fits the code, and a planted fault never stays. Nothing is planted here."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tools.mutants import (
    ROOT,
    Mutant,
    MutantError,
    find_culprit,
    list_changed,
    make_commands,
    place_all,
    plant,
    read_table,
)

MUTANTS = place_all(read_table())
# parts that hurt somebody at once when they are wrong
PARTS = {
    *("relay hub", "relay room", "flow control", "admission", "policy", "share link", "robots file"),
    *("wire decoder, Python", "wire decoder, TypeScript", "segment reader, Python"),
    *("past recorder", "past index", "archive index", "deletions", "CSV, source", "CSV, export"),
    *("kinematics, agent", "kinematics, relay", "kinematics, page", "page liveness", "playout"),
    *("agent publisher", "agent sampler", "model resolver", "ROS merge", "lane, page", "lane, relay"),
}
BOUND = Mutant("bound", "a part", "harms", "a < b", "a > b", ("test_code.py",))
ENDED = """
import signal, sys, time
from pathlib import Path
from tools.mutants import Mutant, end_on_signals, plant

end_on_signals()
mutant = Mutant("bound", "a part", "harms", "a < b", "a > b", ())
with plant(mutant, Path(sys.argv[1]) / "code.py"):
    print("planted", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "code.py").write_text("if a < b:\n")
    os.utime(tmp_path / "code.py", (1_000_000, 1_000_000))
    return tmp_path


def test_they_are_in_every_part_that_matters() -> None:
    assert {placed.mutant.part for placed in MUTANTS} >= PARTS
    assert all(placed.mutant.harm and placed.tests for placed in MUTANTS)


def test_make_test_runs_what_must_catch_them() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    folders = (*settings["tool"]["pytest"]["ini_options"]["testpaths"], "spa/tests")
    for test in {test for placed in MUTANTS for test in placed.tests}:
        assert test.startswith((*(f"{folder}/" for folder in folders), "wire/typescript/tests/")), test
        assert (ROOT / test).name.startswith("test_") or test.endswith(".test.ts"), test


def test_a_fault_finds_its_place_and_its_tests_wherever_they_have_moved(tmp_path: Path) -> None:
    for path, text in {"src/new/place.py": "if a < b:\n", "tests/new/test_code.py": ""}.items():
        (tmp_path / "relay" / path).parent.mkdir(parents=True)
        (tmp_path / "relay" / path).write_text(text)
    (placed,) = place_all([BOUND], tmp_path)
    assert (placed.file, placed.tests) == ("relay/src/new/place.py", ("relay/tests/new/test_code.py",))
    (tmp_path / "relay/tests/new/test_code.py").unlink()
    with pytest.raises(MutantError, match=r"^bound: 0 files test_code\.py in relay/tests, not one$"):
        place_all([BOUND], tmp_path)


@pytest.mark.parametrize(
    ("text", "count"), [("if a < b < c and a < b:\n", r"2 times \(.*code.py\)"), ("", "0 times")]
)
def test_a_text_that_is_not_there_once_is_one_complaint(tmp_path: Path, text: str, count: str) -> None:
    (tmp_path / "relay/src").mkdir(parents=True)
    (tmp_path / "relay/src/code.py").write_text(text)
    with pytest.raises(MutantError, match=f"^bound: its old text occurs {count}, not once: a < b$"):
        place_all([BOUND], tmp_path)


def test_a_fault_goes_with_its_block_and_leaves_no_trace(folder: Path) -> None:
    def fail() -> None:
        with plant(BOUND, folder / "code.py"):
            assert (folder / "code.py").read_text() == "if a > b:\n"
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert (folder / "code.py").read_text() == "if a < b:\n"
    assert (folder / "code.py").stat().st_mtime == 1_000_000


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_takes_the_fault_back(folder: Path, number: int) -> None:
    command = [sys.executable, "-c", ENDED, str(folder)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "planted\n"
        assert (folder / "code.py").read_text() == "if a > b:\n"
        process.send_signal(number)
        assert process.wait(30) == 128 + number
    assert (folder / "code.py").read_text() == "if a < b:\n"


def test_changes_that_are_not_committed_are_found(folder: Path) -> None:
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b"]
    for command in (["init", "-q"], ["add", "code.py"], ["commit", "-qm", "first"]):
        subprocess.run([*git, *command], cwd=folder, check=True)
    assert list_changed(["code.py"], folder) == []
    with plant(BOUND, folder / "code.py"):
        assert list_changed(["code.py"], folder) == ["code.py"]
    assert list_changed(["code.py"], folder) == []


def test_each_test_is_run_by_its_own_program() -> None:
    tests = ("spa/tests/a.test.ts", "relay/tests/test_b.py", "wire/typescript/tests/c.test.ts")
    commands = make_commands(tests)
    assert [(folder, command[-1]) for folder, command in commands] == [
        (ROOT, "relay/tests/test_b.py"),
        (ROOT / "spa", "tests/a.test.ts"),
        (ROOT / "wire/typescript", "tests/c.test.ts"),
    ]


@pytest.mark.parametrize(
    ("said", "culprit"),
    [
        (
            "E  x\nFAILED relay/tests/test_hub.py::test_a[1] - assert 1 == 2\n1 failed\n",
            "test_hub.py::test_a[1]",
        ),
        ("FAILED a/test_b.py::test_c[{'d': 1/2}]\n1 failed\n", "test_b.py::test_c[{'d': 1/2}]"),
        ("ERROR relay/tests/test_hub.py - NameError\n", "test_hub.py"),
        (
            "\x1b[31m FAIL \x1b[39m tests/lane.test.ts > it > goes on\nError\n",
            "tests/lane.test.ts > it > goes on",
        ),
        ("usage: pytest\nno such option\n", "no such option"),
    ],
)
def test_the_first_failed_test_is_named(said: str, culprit: str) -> None:
    assert find_culprit(said) == culprit


def test_two_of_one_name_are_refused(tmp_path: Path) -> None:
    fields = "\n".join(f'{name} = "x"' for name in ("name", "part", "harm", "old", "new"))
    entry = f"[[mutant]]\n{fields}\ntests = []\n"
    (tmp_path / "table.toml").write_text(entry)
    assert read_table(tmp_path / "table.toml") == [Mutant("x", "x", "x", "x", "x", ())]
    (tmp_path / "table.toml").write_text(2 * entry)
    with pytest.raises(MutantError, match="x: two mutants have this name"):
        read_table(tmp_path / "table.toml")
