"""Collects the guide's pages in one folder: docs/, and pages from elsewhere in the repository, and changes
GitHub's Markdown so that the generator reads it the same way."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote

from markdown_it import MarkdownIt

# pages outside docs/, and their place in the guide
MOVED: Mapping[str, str] = {
    "wire/SPEC.md": "reference/wire-format.md",
    "CHANGELOG.md": "project/changelog.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "benches/peers/README.md": "project/peer-benchmarks.md",
}
HOME = Path("index.md")
HOME_META = "---\nhide:\n  - navigation\n  - toc\n  - path\n---\n\n"  # without side columns
FILES = "files"  # the folder for linked files that are not pages
LINK = re.compile(r"(?P<before>\]\(|\b(?:href|src)=\")(?P<target>[^)\s\"]+)")

MARKER = re.compile(r"\s*(?P<marker>(?:[-*+]|\d+[.)])\s+)")
INDENT = 4  # of a list item's content; GitHub uses the width of the marker
MARKDOWN = MarkdownIt("commonmark").enable("table")


def stage_pages(root: Path, out: Path) -> None:
    """Copy all pages of the repository at `root` and their pictures into the folder `out`. Links are changed
    to the new places; a linked file that is not a page is copied too.
    """
    shutil.copytree(root / "docs", out)
    pages = {path: path.relative_to(root / "docs") for path in (root / "docs").rglob("*.md")}
    pages |= {root / page: Path(place) for page, place in MOVED.items()}
    home = {root / "README.md": HOME}  # which becomes a separate page
    for page, place in pages.items():
        text = page.read_text(encoding="utf-8")
        moved = LINK.sub(lambda found: _move_link(found, root, page, place, pages | home, out), text)  # noqa: B023
        moved = indent_lists(moved)
        if place == HOME:
            moved = HOME_META + moved
        (out / place).parent.mkdir(parents=True, exist_ok=True)
        (out / place).write_text(moved, encoding="utf-8")


def _move_link(
    found: re.Match[str], root: Path, page: Path, place: Path, pages: Mapping[Path, Path], out: Path
) -> str:
    name, mark, anchor = found["target"].partition("#")
    file = (page.parent / unquote(name)).resolve()
    if not name or ":" in name or not file.is_relative_to(root) or not file.exists():
        return found[0]
    if file in pages:
        target = pages[file]
    elif file.is_relative_to(root / "docs"):
        target = file.relative_to(root / "docs")
    else:
        target = Path(FILES) / file.relative_to(root)
        if file.is_file():
            (out / target).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, out / target)
    return f"{found['before']}{os.path.relpath(target, place.parent)}{mark}{anchor}"


def indent_lists(page: str) -> str:
    """Indent the content of list items by four spaces; add blank lines before lists, and before items with
    paragraphs."""
    lines = page.split("\n")
    more, needed = [0] * len(lines), [0] * len(lines)  # spaces to add; spaces required in the item
    set_off: set[int] = set()
    before: dict[int, int] = {}  # by level, the first line of the previous item
    for token in MARKDOWN.parse(page):
        if token.map is None:
            continue
        start, end = token.map
        if token.type in ("bullet_list_open", "ordered_list_open"):
            before[token.level + 1] = start
            if token.level == 0:
                set_off.add(start)
        if token.type == "list_item_open" and (found := MARKER.match(lines[start])):
            if not all(line.strip() for line in lines[before[token.level] : start]):
                set_off.add(start)
            before[token.level] = start
            for inside in range(start + 1, end):
                more[inside] += INDENT - len(found["marker"])
                needed[inside] += len(found["marker"])
    made: list[str] = []
    for number, line in enumerate(lines):
        if number in set_off and made and made[-1].strip():
            made.append("")
        belongs = line.strip() and line[: needed[number]].isspace()
        made.append(" " * more[number] + line if belongs else line)
    return "\n".join(made)
