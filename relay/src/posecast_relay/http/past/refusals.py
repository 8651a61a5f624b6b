"""For how long caches may keep what the routes of the past refuse."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import wraps
from typing import Any

from fastapi import HTTPException, Request, Response

NO_STORE = {"cache-control": "private, no-store"}
# what pages of other origins may read
READABLE = {"access-control-expose-headers": "age, date, etag, retry-ms, retry-after"}
FOR_A_SECOND = READABLE | {"cache-control": "public, max-age=1", "vary": "authorization"}
# What passes, or may: a blackout, a robot that is to come, a Redis that is away.
# And an address that there can't be; one with a token in it says by itself that nobody may keep the answer.
SAME_FOR_ALL = frozenset((400, 403, 404, 501, 503))


def tell_caches(route: Callable[..., Awaitable[Response]]) -> Callable[..., Awaitable[Response]]:
    """Wrap a route, whose `request` is given by name: what it refuses has a `cache-control`, its own or the
    one that befits who asked.
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
    """Let caches keep for a second what somebody is told who proves nothing, and nothing else.

    In a blackout a crowd in the lane asks for the same address again and again. What a cache may not keep it
    passes on for each of them, and Varnish goes on so for two minutes. Whoever shows a token may be told
    something else, so it varies with that.
    """
    shows_token = "authorization" in request.headers
    return NO_STORE if shows_token or status not in SAME_FOR_ALL else FOR_A_SECOND
