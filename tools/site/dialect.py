"""Converts GitHub's Markdown so that the generator reads it the same way."""

from __future__ import annotations

import re

from markdown_it import MarkdownIt

MARKER = re.compile(r"\s*(?P<marker>(?:[-*+]|\d+[.)])\s+)")
INDENT = 4  # of a list item's content; GitHub uses the width of the marker
MARKDOWN = MarkdownIt("commonmark").enable("table")


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
