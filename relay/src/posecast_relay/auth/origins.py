"""Decides which pages may show views that are not public. The relay uses no cookies."""

from __future__ import annotations

import re
from collections.abc import Collection

# what a browser sends as `Origin`, without characters that could end a header or a list in it
ORIGIN = re.compile(r"https?://(\[[0-9a-f:]+\]|[A-Za-z0-9._-]+)(:\d{1,5})?")


def may_show(origin: str | None, host: str | None, listed: Collection[str]) -> bool:
    """Whether a page of this `Origin` may show views that are not public.

    None means that the client is not a browser, so its token decides.

    Two kinds of pages may: the relay's own, whose `Origin` matches the request's `host`, and those in
    `listed`. The comparison is exact: `https://good.example.evil.example` and `null` don't match.
    """
    if origin is None:
        return True
    if origin in listed:
        return True
    return ORIGIN.fullmatch(origin) is not None and origin.partition("://")[2] == host
