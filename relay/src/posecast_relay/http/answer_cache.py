"""Caches JSON answers with an ETag. Each is made at most once a second, for any number of requests."""

from __future__ import annotations

import hashlib
from collections.abc import Awaitable, Callable
from typing import NamedTuple

from fastapi import Request, Response

from posecast_relay.http.etags import has_already

FRESH_S = 1.0  # maximum age of an answer
ANSWERS_MAX = 256
ANSWERS_BYTES = 8 << 20


class _Made(NamedTuple):
    at_s: float
    body: bytes
    etag: str


class AnswerCache:
    """Caches JSON answers with an ETag. Each is made at most once a second, for any number of requests."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._made: dict[str, _Made] = {}
        self._bytes = 0

    def get_answer(
        self, request: Request, name: str, make: Callable[[], bytes], more: dict[str, str]
    ) -> Response:
        """Return the answer called `name`, or 304 if the client already has it. `more`: further headers."""
        return _send(request, self._find(name) or self._keep(name, make()), more)

    async def load_answer(
        self, request: Request, name: str, load: Callable[[], Awaitable[bytes]], more: dict[str, str]
    ) -> Response:
        """Return the answer called `name`, as `get_answer` does, if it takes time to make."""
        return _send(request, self._find(name) or self._keep(name, await load()), more)

    def clear(self) -> None:
        """Forget all answers."""
        self._made.clear()
        self._bytes = 0

    def _find(self, name: str) -> _Made | None:
        # the only place that decides whether an answer is fresh: asked twice, the clock may have moved on
        made = self._made.get(name)
        return made if made is not None and self._now() - made.at_s < FRESH_S else None

    def _keep(self, name: str, body: bytes) -> _Made:
        made = _Made(self._now(), body, f'"{hashlib.sha256(body).hexdigest()[:16]}"')
        before = self._made.pop(name, None)
        self._bytes += len(body) - (0 if before is None else len(before.body))
        if self._bytes > ANSWERS_BYTES or len(self._made) >= ANSWERS_MAX:
            self._made.clear()
            self._bytes = len(body)
        self._made[name] = made
        return made


def _send(request: Request, made: _Made, more: dict[str, str]) -> Response:
    headers = {"etag": made.etag, "cache-control": "public, max-age=1"} | more
    if has_already(request, made.etag):
        return Response(status_code=304, headers=headers)
    return Response(made.body, media_type="application/json", headers=headers)
