"""Caches JSON answers with an ETag. Each is made at most once a second, for any number of requests."""

from __future__ import annotations

import hashlib
from collections.abc import Callable

from fastapi import Request, Response

from posecast_relay.http.etags import has_already

FRESH_S = 1.0  # maximum age of an answer
ANSWERS_MAX = 256
ANSWERS_BYTES = 8 << 20


class AnswerCache:
    """Caches JSON answers with an ETag. Each is made at most once a second, for any number of requests."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._made: dict[str, tuple[float, bytes, str]] = {}
        self._bytes = 0

    def has(self, name: str) -> bool:
        """Whether a fresh answer with this name is cached."""
        made = self._made.get(name)
        return made is not None and self._now() - made[0] < FRESH_S

    def get_answer(
        self, request: Request, name: str, make: Callable[[], bytes], more: dict[str, str]
    ) -> Response:
        """Return the answer called `name`, or 304 if the client already has it. `more`: further headers."""
        now = self._now()
        made = self._made.get(name)
        if made is None or now - made[0] >= FRESH_S:
            body = make()
            made = (now, body, f'"{hashlib.sha256(body).hexdigest()[:16]}"')
            self._keep(name, made)
        _, body, etag = made
        headers = {"etag": etag, "cache-control": "public, max-age=1"} | more
        if has_already(request, etag):
            return Response(status_code=304, headers=headers)
        return Response(body, media_type="application/json", headers=headers)

    def clear(self) -> None:
        """Forget all answers."""
        self._made.clear()
        self._bytes = 0

    def _keep(self, name: str, made: tuple[float, bytes, str]) -> None:
        before = self._made.pop(name, None)
        self._bytes += len(made[1]) - (len(before[1]) if before is not None else 0)
        if self._bytes > ANSWERS_BYTES or len(self._made) >= ANSWERS_MAX:
            self._made.clear()
            self._bytes = len(made[1])
        self._made[name] = made
