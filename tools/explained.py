"""Writes the tables in docs/reference/signs.md from the page's own explanations, so that both agree.

python -m tools.explained: replaces the text between two lines

    <!-- explained: SECTION -->
    <!-- explained end -->

with a table of that section of spa/src/app/explain/en.json. The section `flags` becomes a table of the flag
bits in the agent's bundled profiles.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from posecast_edge.profile.reader import SHIPPED, load_profile

ROOT = Path(__file__).resolve().parent.parent
CATALOGUES = ROOT / "spa/src/app/explain"
PAGE = ROOT / "docs/reference/signs.md"
BLOCK = re.compile(
    r"(?P<first><!-- explained: (?P<section>\S+) -->\n)(?P<table>.*?)(?P<last><!-- explained end -->\n)",
    re.DOTALL,
)
HEADS = {
    "signs": "sign",
    "balance": "sign of balance",
    "columns": "column",
    "units": "unit",
    "words": "word",
    "timeLine": "mark",
    "sensors": "sensor",
}

Section = dict[str, dict[str, str]]


def read_catalogue(language: str) -> dict[str, Section]:
    """The page's explanations in this language: section → key → texts."""
    found: dict[str, Section] = json.loads((CATALOGUES / f"{language}.json").read_text(encoding="utf-8"))
    return found


def write_page(text: str, catalogue: dict[str, Section]) -> str:
    """The page with updated tables. Raises ValueError if it names a section that does not exist."""

    def table_of(block: re.Match[str]) -> str:
        section = block["section"]
        if section == "flags":
            table = _flags()
        elif section in catalogue:
            table = _section(HEADS[section], catalogue[section])
        else:
            raise ValueError(f"no section {section!r}; the sections are {', '.join(catalogue)}, flags")
        return f"{block['first']}\n{table}\n{block['last']}"

    return BLOCK.sub(table_of, text)


def _section(head: str, entries: Section) -> str:
    more = any("from" in entry for entry in entries.values())
    columns = ["name", "what", "how", *(["from"] if more else [])]
    heads = [head, "means", "how it is known", *(["comes from"] if more else [])]
    rows = [[f"**{e['name']}**", *(e.get(column, "") for column in columns[1:])] for e in entries.values()]
    return _table(heads, rows)


def _flags() -> str:
    """Each bit once: bundled profiles describe the same bit in the same way."""
    rows: dict[str, list[str]] = {}
    for path in sorted(SHIPPED.glob("*.toml")):
        for bits in load_profile(path).mapping.sentences.values():
            for bit, by_language in bits.items():
                told = by_language["en"]
                rows.setdefault(bit, [f"`{bit}`", told.say, told.why or ""])
    return _table(["flag", "what the page says", "how it is known"], list(rows.values()))


def _table(heads: list[str], rows: list[list[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |\n" for line in lines)


def main() -> None:
    """Update the page."""
    text = write_page(PAGE.read_text(encoding="utf-8"), read_catalogue("en"))
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
