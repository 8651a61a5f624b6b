"""The pages for people who run a relay, and their commands as a reader would copy them."""

from __future__ import annotations

import re
from pathlib import Path
from textwrap import dedent

DOCS = Path(__file__).resolve().parents[2] / "docs"
SCALE = ("gateways", "more-robots", "redis")
REFERENCE = ("archive", "log-messages", "metrics", "robots-file", "settings")
PAGES = sorted(
    [
        *(DOCS / "how-to/operate").glob("*.md"),
        *(DOCS / f"how-to/scale/{name}.md" for name in SCALE),
        DOCS / "how-to/install/cloud.md",
        *(DOCS / f"reference/{name}.md" for name in REFERENCE),
    ]
)


def list_commands(page: str) -> list[str]:
    """The lines of its shell blocks, in order; `page` is named below docs/."""
    text = (DOCS / page).read_text(encoding="utf-8")
    found = re.findall(r"^( *)```sh\n(.*?)^ *```", text, re.DOTALL | re.MULTILINE)
    return [line for _, block in found for line in dedent(block).splitlines()]
