"""docs/reference/log-messages.md has every message of the relay's log, and no other."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/reference/log-messages.md").read_text(encoding="utf-8")
SOURCES = sorted((ROOT / "relay/src").rglob("*.py"))
LEVELS = {"exception": "error", "log": "warning"}  # what a call of that name is on the page
NAMES = {"info", "warning", "error", "critical", *LEVELS}
PLACE = re.compile(r"%[.\d]*[sdfgr]")


def list_messages(source: str) -> Iterator[tuple[str, str]]:
    """Message and level of each call `log.…("…")`; `…` for each value that is put in."""
    for node in ast.walk(ast.parse(source)):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        if ast.unparse(node.func.value) != "log" or node.func.attr not in NAMES:
            continue
        text = node.args[1 if node.func.attr == "log" else 0]
        assert isinstance(text, ast.Constant), f"a message that the page can't have: {ast.unparse(text)}"
        message = PLACE.sub("…", str(text.value))
        # without any words of its own it is another message, passed on
        if re.search(r"\w", message) and node.func.attr != "exception":
            yield message, LEVELS.get(node.func.attr, node.func.attr)


def test_the_page_has_every_message_with_its_level() -> None:
    found = {each for path in SOURCES for each in list_messages(path.read_text(encoding="utf-8"))}
    rows = re.findall(r"^\| (`+) ?(.+?) ?\1 \| (\w+) \|", PAGE, re.MULTILINE)
    shown = [(message, level) for _, message, level in rows]
    assert len(shown) == len(set(shown))
    assert {each for each in shown if re.search(r"\w", each[0])} == found


def test_a_message_is_found_wherever_it_is_written() -> None:
    source = 'log.log(level, "a: %s", b)\nif x:\n    log.error("c %.3g: " "%d", 1, 2)\nlog.info("%s", e)\n'
    assert set(list_messages(source)) == {("a: …", "warning"), ("c …: …", "error")}
