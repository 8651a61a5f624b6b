"""Every file named by the pages on architecture and on extending Posecast exists."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.docs

REPO = Path(__file__).resolve().parent.parent
OVERVIEW = REPO / "docs/ARCHITECTURE.md"
PARTS = ("edge-agent", "fault-isolation", "lane", "libraries-not-used", "relay", "rendering", "web-page")
PAGES = (
    OVERVIEW,
    *(REPO / f"docs/explanation/{part}.md" for part in (*PARTS, "multiple-relays")),
    *sorted((REPO / "docs/how-to/extend").glob("*.md")),
)
ROOTS = (
    REPO,
    REPO / "edge-agent/src/posecast_edge",
    REPO / "relay/src/posecast_relay",
    REPO / "spa/src",
    REPO / "spa/src/stream/lane",
    REPO / "wire",
)


def find_names(page: Path) -> list[str]:
    """The files and folders that a page names."""
    return re.findall(r"`([\w-][\w./-]*/(?:[\w.-]+\.\w+)?)`", page.read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_it_names_exists(page: Path) -> None:
    missing = [name for name in find_names(page) if not any((root / name).exists() for root in ROOTS)]
    assert missing == []


def test_it_names_a_file_for_each_step() -> None:
    steps = re.findall(r"^\| (\d+) \| (?:edge|relay|page) `", OVERVIEW.read_text(), re.MULTILINE)
    assert [int(step) for step in steps] == list(range(1, 15))


def test_the_pages_name_many_files() -> None:
    assert len(find_names(OVERVIEW)) > 40
    assert len({name for page in PAGES for name in find_names(page)}) > 200
