"""A harness that finds nothing proves nothing: it must find what is broken on purpose."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import fuzz.target
from fuzz.child import LED
from fuzz.target import YARD_S, Target, judge

ROOT = Path(__file__).parents[2]
BROKEN = {
    "magic": "KeyError in tests/broken_readers.py",
    "square": "bytes",
    "greedy": "MB for ",
    "deadly": "its process died",
    "talkative": "ValueError of 3019 letters",
    "unlike": "value: 1 here, 2 there",
}
WITHOUT_ATHERIS = """
import sys
sys.modules["atheris"] = None
from fuzz.tests.broken_readers import main
main(*sys.argv[1:])
"""
Found = dict[str, tuple[int, list[tuple[str, str]]]]  # executions, and what was found in which file


def play(*command: str) -> Found:
    shown = subprocess.run([sys.executable, *command], cwd=ROOT, capture_output=True, text=True, check=True)
    found: Found = json.loads(shown.stdout)
    return found


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Found:
    return play("-m", "fuzz.tests.broken_readers", str(tmp_path_factory.mktemp("findings")), "40", *BROKEN)


@pytest.mark.parametrize("target", BROKEN)
def test_finds_what_is_broken(found: Found, target: str) -> None:
    if not LED and target == "magic":
        pytest.skip("without atheris nothing leads there")
    _, findings = found[target]
    assert BROKEN[target] in findings[0][0]


def test_the_case_is_kept_short_and_beside_it_why(found: Found) -> None:
    _, [(_, file), *_] = found["unlike"]
    assert Path(file).read_bytes() == b"e"
    assert "1 here, 2 there" in Path(f"{file}.txt").read_text()


def test_finds_nothing_where_nothing_is_broken(tmp_path: Path) -> None:
    executions, findings = play("-m", "fuzz.tests.broken_readers", str(tmp_path), "1", "sound")["sound"]
    assert not findings
    assert executions > 10


# `make test` fuzzes by itself; on a busy machine two seconds are too few, and it tries again and again
@pytest.mark.full
def test_what_typescript_does_leads_too_and_only_findings_are_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    command = [sys.executable, "-m", "fuzz", "--seconds", "2", "robots-file", "page-message"]
    rows = (subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False) for _ in range(20))
    assert any(not LED or re.search(r"^page-message .* coverage +[1-9]", row.stdout, re.M) for row in rows)
    assert not list(tmp_path.iterdir())


def test_without_atheris_cases_are_changed_at_random(tmp_path: Path) -> None:
    found = play("-c", WITHOUT_ATHERIS, str(tmp_path), "40", "square", "unlike", "talkative")
    assert all(findings for _, findings in found.values())


@pytest.mark.parametrize(("slower", "dear"), [(1, True), (3, False), (0.5, True)])
def test_a_case_may_cost_more_where_all_work_does(
    monkeypatch: pytest.MonkeyPatch, slower: float, dear: bool
) -> None:
    def read(_data: bytes) -> None:
        fuzz.target.CLOCK.elsewhere_s += 0.1

    monkeypatch.setattr(fuzz.target, "walk_a_yard", lambda: YARD_S * slower)
    found = judge(Target("slow", read, ms=50, ms_per_kb=0), b"1")
    assert (found is not None and found.kind == "cost") == dear
