"""Tables as Markdown, and the blocks of a page that a program writes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table."""
    lines = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)])


def fill(page: str, blocks: Mapping[str, str], where: str) -> str:
    """The page with its blocks made anew, each between `<!-- NAME: … -->` and `<!-- /NAME -->`. Raises
    ValueError, with `where`, when a marker is missing."""
    for name, block in blocks.items():
        pattern = rf"(<!-- {name}: .*? -->\n).*?(<!-- /{name} -->)"
        page, found = re.subn(pattern, rf"\g<1>\n{block}\n\n\g<2>", page, flags=re.DOTALL)
        if found != 1:
            raise ValueError(f"{where}: {found} blocks called {name!r}, one is needed")
    return page
