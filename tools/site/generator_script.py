"""Changes the generator's script: for a strict content policy, and so that one search index is enough."""

from __future__ import annotations

import re
from pathlib import Path

# it puts the style of its search dialog into the page as an element, which a content policy forbids
STYLE_ELEMENT = re.compile(
    r"(?P<root>\w+)\.appendChild\(\w+\(\"style\",\{\},(?P<style>\w+)\.toString\(\)\)\)"
)
STYLE_SHEET = r"(s=>{s.replaceSync(\g<style>.toString());\g<root>.adoptedStyleSheets=[s]})(new CSSStyleSheet)"
# pages opened from files read the index as a script, others fetch the same as JSON
READS_SCRIPT = re.compile(r'location\.protocol==="file:"(?=\?\w+\(`\$\{new URL\("search\.js")')
ALWAYS = "!0"
INDEX_AS_JSON = "search.json"


def change_script(site: Path) -> None:
    """Let the script adopt its style as a sheet and read the index as a script always; remove the index as
    JSON. Raises ValueError when the script is another one than was expected.
    """
    (script,) = (site / "assets/javascripts").glob("bundle.*.js")
    text = script.read_text(encoding="utf-8")
    for pattern, instead in ((STYLE_ELEMENT, STYLE_SHEET), (READS_SCRIPT, ALWAYS)):
        text, count = pattern.subn(instead, text)
        if count != 1:
            raise ValueError(
                f"{script.name}: {count} of {pattern.pattern}, 1 expected: another version of Zensical?"
            )
    script.write_text(text, encoding="utf-8")
    (site / INDEX_AS_JSON).unlink()
