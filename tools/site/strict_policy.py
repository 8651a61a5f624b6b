"""Lets the generator's script work under a content policy that forbids styles in pages."""

from __future__ import annotations

import re
from pathlib import Path

# it puts the style of its search dialog into the page as an element
STYLE_ELEMENT = re.compile(
    r"(?P<root>\w+)\.appendChild\(\w+\(\"style\",\{\},(?P<style>\w+)\.toString\(\)\)\)"
)
STYLE_SHEET = r"(s=>{s.replaceSync(\g<style>.toString());\g<root>.adoptedStyleSheets=[s]})(new CSSStyleSheet)"


def adopt_style(site: Path) -> None:
    """Make it a style sheet that its script adopts. Raises ValueError when there is nothing of the kind."""
    (script,) = (site / "assets/javascripts").glob("bundle.*.js")
    text, count = STYLE_ELEMENT.subn(STYLE_SHEET, script.read_text(encoding="utf-8"))
    if count != 1:
        raise ValueError(f"{script.name}: {count} style elements, 1 expected: another version of Zensical?")
    script.write_text(text, encoding="utf-8")
