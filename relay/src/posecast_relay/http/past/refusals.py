"""Decides how long caches may keep refusals of the routes of the past."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import wraps
from typing import Any

from fastapi import HTTPException, Request, Response

NO_STORE = {"cache-control": "private, no-store"}
# headers that pages of other origins may read
READABLE = {"access-control-expose-headers": "age, date, etag, retry-ms, retry-after"}
FOR_A_SECOND = READABLE | {"cache-control": "public, max-age=1", "vary": "authorization"}
# Statuses that may pass: a blackout, a robot that is not there yet, Redis away. Also malformed addresses;
# the response to one that contains a token is already marked as not cacheable.
SAME_FOR_ALL = frozenset((400, 403, 404, 501, 503))


def tell_caches(route: Callable[..., Awaitable[Response]]) -> Callable[..., Awaitable[Response]]:
    """Wrap a route, which takes `request` by name, so that its refusals have a `cache-control` header.

    That is the refusal's own header, or one that fits the caller.
    """

    @wraps(route)
    async def answer(**asked: Any) -> Response:
        try:
            return await route(**asked)
        except HTTPException as e:
            headers = _choose_headers(asked["request"], e.status_code) | dict(e.headers or {})
            raise HTTPException(e.status_code, e.detail, headers) from None

    return answer


def _choose_headers(request: Request, status: int) -> dict[str, str]:
    """Let caches keep refusals for a second, but only those for callers without a token.

    In a blackout many lane readers request the same address again and again. A response that may not be
    cached is passed on for each of them, and Varnish continues to do so for two minutes. A caller with a
    token may get another response, so it varies with that.
    """
    shows_token = "authorization" in request.headers
    return NO_STORE if shows_token or status not in SAME_FOR_ALL else FOR_A_SECOND
