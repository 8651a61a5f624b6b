"""Decides which pages may show views that are not open to anyone. Cookies are never used for that."""

from __future__ import annotations

import re
from collections.abc import Collection

# what a browser sends as `Origin`, and nothing that could end a header or a list in one
ORIGIN = re.compile(r"https?://(\[[0-9a-f:]+\]|[A-Za-z0-9._-]+)(:\d{1,5})?")


def may_show(origin: str | None, host: str | None, listed: Collection[str]) -> bool:
    """Whether a page of this `Origin` may show what is not open to anyone.

    None: no browser, so a token decides.

    The relay's own pages may (their `Origin` is the `host` that was asked), and those of `listed`, compared
    exactly: `https://good.example.evil.example` is neither, nor is `null`.
    """
    if origin is None:
        return True
    if origin in listed:
        return True
    return ORIGIN.fullmatch(origin) is not None and origin.partition("://")[2] == host
