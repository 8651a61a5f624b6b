"""Tables as Markdown, and where docs/reference/benchmarks.md has them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from relay.benches.build import ROOT

PAGE = ROOT / "docs" / "reference/benchmarks.md"


def markdown(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table."""
    table = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    return "\n".join([*table, *(f"| {' | '.join(line)} |" for line in lines)])


def fill(page: str, blocks: Mapping[str, str]) -> str:
    """The page with its blocks made anew. ValueError when a marker is missing."""
    for name, block in blocks.items():
        pattern = rf"(<!-- {name}: .*? -->\n).*?(<!-- /{name} -->)"
        page, found = re.subn(pattern, rf"\g<1>\n{block}\n\n\g<2>", page, flags=re.DOTALL)
        if found != 1:
            raise ValueError(f"benchmarks.md: {found} blocks called {name!r}, one is needed")
    return page
