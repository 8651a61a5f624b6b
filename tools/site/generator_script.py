"""Changes the generator's script: it must work with a strict Content-Security-Policy, with a single search
index and with screen readers."""

from __future__ import annotations

import re
from pathlib import Path

# it inserts the style of its search dialog as an element, which the Content-Security-Policy forbids
STYLE_ELEMENT = re.compile(
    r"(?P<root>\w+)\.appendChild\(\w+\(\"style\",\{\},(?P<style>\w+)\.toString\(\)\)\)"
)
STYLE_SHEET = r"(s=>{s.replaceSync(\g<style>.toString());\g<root>.adoptedStyleSheets=[s]})(new CSSStyleSheet)"
# pages opened from files read the index as a script; others fetch the same as JSON
READS_SCRIPT = re.compile(r'location\.protocol==="file:"(?=\?\w+\(`\$\{new URL\("search\.js")')
ALWAYS = "!0"
# the buttons of each code block were a landmark without a name
CODE_BUTTONS = re.compile(r'\("nav",(?=\{class:"md-code__nav"\})')
INDEX_AS_JSON = "search.json"


def change_script(site: Path) -> None:
    """Make the script adopt its style as a sheet, always read the index as a script and show a code block's
    buttons in no landmark; remove the JSON index. Raises ValueError if the script is not the expected one.
    """
    (script,) = (site / "assets/javascripts").glob("bundle.*.js")
    text = script.read_text(encoding="utf-8")
    changes = ((STYLE_ELEMENT, STYLE_SHEET), (READS_SCRIPT, ALWAYS), (CODE_BUTTONS, '("div",'))
    for pattern, instead in changes:
        text, count = pattern.subn(instead, text)
        if count != 1:
            raise ValueError(f"{script.name}: {count} of {pattern.pattern}, expected 1; did Zensical change?")
    script.write_text(text, encoding="utf-8")
    (site / INDEX_AS_JSON).unlink()
