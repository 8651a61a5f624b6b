"""What a built page says it may load, so that it can be sent as a header."""

from __future__ import annotations

import html
import re
from functools import lru_cache
from pathlib import Path

POLICY = re.compile(r'(?i)<meta\s+http-equiv="content-security-policy"\s+content="([^"]*)"')
PAGES_MAX = 256  # whose policies are remembered


def read_content_policy(page: Path) -> str | None:
    """Return a page's content security policy; None when it has none.

    As a header it binds its workers too.
    """
    try:
        return _read_policy(page, page.stat().st_mtime_ns)
    except OSError:  # it is just being built anew
        return None


@lru_cache(maxsize=PAGES_MAX)
def _read_policy(page: Path, _mtime_ns: int) -> str | None:
    found = POLICY.search(page.read_text(encoding="utf-8"))
    return None if found is None else " ".join(html.unescape(found[1]).split())
