"""Checks by ETag whether a client already has an answer."""

from __future__ import annotations

from fastapi import Request


def has_already(request: Request, etag: str) -> bool:
    """Whether `If-None-Match` names this `etag`, with its quotes; `*` matches any."""
    named = request.headers.get("if-none-match", "")
    return etag in named or named.strip() == "*"
