"""Which pages may show what is not for everybody. No cookie is ever looked at, so this is a second lock."""

from __future__ import annotations

import re
from collections.abc import Collection

# what a browser sends as `Origin`, and nothing that could end a header or a list in one
ORIGIN = re.compile(r"https?://(\[[0-9a-f:]+\]|[A-Za-z0-9._-]+)(:\d{1,5})?")


def may_show(origin: str | None, host: str | None, listed: Collection[str]) -> bool:
    """Whether a page of that `Origin` may. None: no browser asks, and whoever asks has shown a token.

    The relay's own pages may (`Origin` names the very host that was asked), and those that are listed, letter
    by letter: `https://good.example.evil.example` is neither, nor is `null`.
    """
    if origin is None:
        return True
    if origin in listed:
        return True
    return ORIGIN.fullmatch(origin) is not None and origin.partition("://")[2] == host
