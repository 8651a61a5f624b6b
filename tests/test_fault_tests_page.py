"""docs/reference/fault-tests.md names existing tests, and all ways to break components on purpose."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.docs

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs/reference/fault-tests.md").read_text(encoding="utf-8")
FAULTS = ROOT / "tests/faults"


def rows(heading: str) -> list[list[str]]:
    """The cells of the table below a heading that begins so, without its head."""
    (section,) = re.findall(rf"^## {heading}[^\n]*$(.*?)(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE)
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[1:]]


def test_each_browser_test_exists() -> None:
    named = {name for *_, tests in rows("Browser tests") for name in re.findall(r"`(\w+)`", tests)}
    assert len(named) > 10
    for name in named:
        assert (ROOT / f"spa/e2e/{name}.test.ts").is_file(), name
    for name in re.findall(r"unit test `(\w+)`", PAGE):
        assert len([*(ROOT / "spa/tests").glob(f"**/{name}.test.ts")]) == 1, name


def test_each_way_to_break_a_part_is_listed() -> None:
    listed = [(part, re.findall(r"^`(\w+)`", promise)[0]) for part, promise, *_ in rows("Broken parts")]
    written = [
        (part, way)
        for part, file in (("relay", "broken_relay.py"), ("agent", "broken_edge.py"))
        for way in re.findall(r'"(\w+)": \w+[,}]', (FAULTS / file).read_text(encoding="utf-8"))
    ]
    assert listed == written


def test_each_file_that_is_named_exists() -> None:
    named = re.findall(r"tests/faults/\w+\.\w+", PAGE)
    assert named
    for path in named:
        assert (ROOT / path).is_file(), path
