"""Every file that docs/ARCHITECTURE.md names is there: whoever follows the page arrives."""

from __future__ import annotations

import re
from pathlib import Path

REPO = Path(__file__).resolve().parent.parent
PAGE = (REPO / "docs/ARCHITECTURE.md").read_text()
ROOTS = (REPO, REPO / "edge-agent/src/posecast_edge", REPO / "relay/src/posecast_relay", REPO / "spa/src")
NAMED = sorted(set(re.findall(r"`([\w-][\w./-]*/(?:[\w.-]+\.(?:py|ts|tsx|md|json))?)`", PAGE)))


def test_what_it_names_is_there() -> None:
    missing = [name for name in NAMED if not any((root / name).exists() for root in ROOTS)]
    assert missing == []


def test_it_names_a_file_for_each_step() -> None:
    steps = re.findall(r"^\| (\d+) \| (?:edge|relay|page) `", PAGE, re.MULTILINE)
    assert [int(step) for step in steps] == list(range(1, 15))
    assert len(NAMED) > 60
