"""Reads a built page's content security policy, so that it can be sent as a header."""

from __future__ import annotations

import html
import re
from functools import lru_cache
from pathlib import Path

POLICY = re.compile(r'(?i)<meta\s+http-equiv="content-security-policy"\s+content="([^"]*)"')
PAGES_MAX = 256  # whose policies are cached


def read_content_policy(page: Path) -> str | None:
    """Return a page's content security policy; None if it has none.

    Sent as a header, the policy also applies to the page's workers.
    """
    try:
        return _read_policy(page, page.stat().st_mtime_ns)
    except OSError:  # it is being rebuilt right now
        return None


@lru_cache(maxsize=PAGES_MAX)
def _read_policy(page: Path, _mtime_ns: int) -> str | None:
    found = POLICY.search(page.read_text(encoding="utf-8"))
    return None if found is None else " ".join(html.unescape(found[1]).split())
