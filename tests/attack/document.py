"""The tables of docs/reference/attack-tests.md, from the last `make attack WRITE=1`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from tests.attack.figure import Figure
from tests.attack.row import HEAD, Row, cells

FILE = Path(__file__).parents[2] / "docs/reference/attack-tests.md"
BEGIN = "<!-- written by `make attack WRITE=1` -->\n"
END = "<!-- until here -->\n"


def text(rows: Sequence[Row], figures: Sequence[Figure]) -> str:
    """The measurements, for people."""
    lines = [f"| {' | '.join(HEAD)} |", "|---" * 2 + "|---:" * (len(HEAD) - 2) + "|"]
    lines += [f"| {' | '.join((row.what, *cells(row)))} |" for row in rows]
    lines += ["", "| further checks | measured | limit |", "|---|---:|---:|"]
    lines += [
        f"| {each.what} | {each.found:.2f} {each.unit}{each.more} | ≤ {each.limit:g} {each.unit} |"
        for each in figures
    ]
    cores = len(os.sched_getaffinity(0))
    return "\n".join(
        [f"Measured on {cores} cores, shared by relay, robots, viewers and attackers:", "", *lines, ""]
    )


def put(document: str, table: str) -> str:
    """The document with a new table. ValueError if it has no place for one."""
    before, begin, rest = document.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"no place for the table: {BEGIN.strip()} … {END.strip()}")
    return f"{before}{begin}\n{table}\n{end}{after}"


def write(rows: Sequence[Row], figures: Sequence[Figure]) -> None:
    """Writes the file."""
    FILE.write_text(put(FILE.read_text(), text(rows, figures)))
