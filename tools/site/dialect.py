"""Turns Markdown as GitHub reads it into what the generator reads the same way."""

from __future__ import annotations

import re

from markdown_it import MarkdownIt

MARKER = re.compile(r"\s*(?P<marker>(?:[-*+]|\d+[.)])\s+)")
INDENT = 4  # of what belongs to an item of a list, where GitHub takes the width of its marker
MARKDOWN = MarkdownIt("commonmark").enable("table")


def indent_lists(page: str) -> str:
    """Indent what belongs to items of lists by four spaces; set lists, and items of paragraphs, off."""
    lines = page.split("\n")
    more, needed = [0] * len(lines), [0] * len(lines)  # spaces to add, and spaces of a line that belongs
    set_off: set[int] = set()
    before: dict[int, int] = {}  # by level, where the item before begins
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
