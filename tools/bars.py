"""Plots the tables in docs/reference/benchmarks.md. The figures are read from the page, so that both agree.

python -m tools.bars: for every table under a line

    <!-- bars: ../img/NAME.svg | TITLE | COLUMN | UNIT -->

writes NAME.svg, relative to the page: one bar per row, by the first number in that column. Rows without a
number have no bar.
"""

from __future__ import annotations

import re
from pathlib import Path

from tools import plot

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "reference/benchmarks.md"
MARKER = re.compile(
    r"^<!-- bars: (?P<file>\S+) \| (?P<title>[^|]+) \| (?P<column>[^|]+) \| (?P<unit>[^|]*) -->$"
)
NUMBER = re.compile(r"\d[\d,]*(?:\.\d+)?")


def cells(line: str) -> list[str]:
    """The cells of one row, without emphasis."""
    return [cell.replace("*", "").replace("`", "").strip() for cell in line.strip().strip("|").split("|")]


def bars_of(page: str) -> dict[str, str]:
    """File → SVG. Raises ValueError, naming the marker, if its table or column is missing."""
    lines, found = page.splitlines(), dict[str, str]()
    for number, line in enumerate(lines):
        marker = MARKER.match(line)
        if marker is None:
            continue
        rest = [text for text in lines[number + 1 :] if text.strip()]
        rows = []
        for text in rest:
            if not text.startswith("|"):
                break
            rows.append(cells(text))
        if len(rows) < 3 or marker["column"] not in rows[0]:
            raise ValueError(
                f"benchmarks.md:{number + 1}: no table with a column {marker['column']!r} follows"
            )
        at = rows[0].index(marker["column"])
        figures = [(row[0], NUMBER.search(row[at])) for row in rows[2:]]
        values = [(name, float(figure[0].replace(",", ""))) for name, figure in figures if figure]
        found[marker["file"]] = plot.bars(marker["title"], marker["unit"], values)
    return found


def draw() -> None:
    """Write all plots of the page."""
    for name, image in bars_of(PAGE.read_text()).items():
        (PAGE.parent / name).write_text(image)


if __name__ == "__main__":
    draw()
