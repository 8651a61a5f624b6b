"""Cheap requests."""

from __future__ import annotations

from functools import cache

import httpx
from httpx._transports import default


def share_trust() -> None:
    """Let all clients of httpx share what they trust: reading 140 authorities takes ten times a request."""
    default.create_ssl_context = cache(httpx.create_ssl_context)  # type: ignore[attr-defined]
