"""Every row of the tables of threats names tests that exist."""

from __future__ import annotations

import re
from pathlib import Path

REPO = Path(__file__).resolve().parents[2]
THREATS = REPO / "docs/reference/threats.md"
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
