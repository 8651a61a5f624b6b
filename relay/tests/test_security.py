"""Every row of the threat table names tests that exist."""

from __future__ import annotations

import re
from pathlib import Path

REPO = Path(__file__).resolve().parents[2]
PAGE = (REPO / "docs" / "SECURITY.md").read_text()


def test_every_threat_has_a_test_that_exists() -> None:
    table = PAGE.partition("## Threats")[2].partition("\n## ")[0]
    rows = [line for line in table.splitlines() if line.startswith("| ")][1:]
    assert len(rows) > 25
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
