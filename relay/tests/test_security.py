"""Every row of the tables of threats names tests that exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[2]
THREATS = REPO / "docs/reference/threats.md"
OVERVIEW = REPO / "docs/SECURITY.md"
HEAD = "| threat | defence | proven by |"


def test_every_threat_has_a_test_that_exists() -> None:
    rows = [line for line in THREATS.read_text().splitlines() if line.startswith("| ") and line != HEAD]
    assert len(rows) > 70
    for row in rows:
        named = re.findall(r"`([\w./-]+)::([^`]+)`", row.split(" | ")[-1])
        assert named, row
        for file, test in named:
            text = (REPO / file).read_text()
            there = (
                rf"def {test}\("
                if file.endswith(".py")
                else rf"\bit(\.\w+\(!?\w+\))?\(\s*'{re.escape(test)}'"
            )
            assert re.search(there, text), f"{file} has no {test}"


def find_anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", [OVERVIEW, THREATS], ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([\w./-]*)(?:#([\w-]+))?\)", page.read_text())
    assert len(links) > 2
    for file, anchor in links:
        target = page.parent / file if file else page
        assert target.exists(), file
        assert not anchor or anchor in find_anchors(target), f"{file}#{anchor}"
