"""Caches JSON answers with an ETag, and describes answers for OpenAPI."""

from __future__ import annotations

import hashlib
from collections.abc import Awaitable, Callable
from functools import reduce
from operator import or_
from typing import Any, NamedTuple

from fastapi import Request, Response
from pydantic import BaseModel, ConfigDict

from posecast_relay.kit import ExpiringCache

FRESH_S = 1.0  # maximum age of an answer
ANSWERS_BYTES = 8 << 20
ANSWER_BYTES = 32 << 10  # what an answer costs at least, so that there are at most 256


class _Made(NamedTuple):
    body: bytes
    etag: str


class AnswerCache:
    """Caches JSON answers with an ETag. Each is made at most once a second, for any number of requests."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._made: ExpiringCache[_Made] = ExpiringCache(ANSWERS_BYTES)

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
        self._made.forget(lambda _: True)

    def _find(self, name: str) -> _Made | None:
        # the only place that decides whether an answer is fresh: asked twice, the clock may have moved on
        return self._made.find(name, self._now())

    def _keep(self, name: str, body: bytes) -> _Made:
        made = _Made(body, f'"{hashlib.sha256(body).hexdigest()[:16]}"')
        self._made.put(name, made, max(len(body), ANSWER_BYTES), self._now() + FRESH_S)
        return made


def _send(request: Request, made: _Made, more: dict[str, str]) -> Response:
    headers = {"etag": made.etag, "cache-control": "public, max-age=1"} | more
    return send_named(request, made.body, "application/json", headers)


def send_named(request: Request, body: bytes, media_type: str, headers: dict[str, str]) -> Response:
    """Return a body whose ETag is in `headers`; 304 if the client already has it."""
    if has_already(request, headers["etag"]):
        return Response(status_code=304, headers=headers)
    return Response(body, media_type=media_type, headers=headers)


def has_already(request: Request, etag: str) -> bool:
    """Whether `If-None-Match` names this `etag`, with its quotes; `*` matches any."""
    named = request.headers.get("if-none-match", "")
    return etag in named or named.strip() == "*"


Described = dict[int | str, dict[str, Any]]  # answers for OpenAPI, by status


class AnswerDocument(BaseModel):
    """A document that has exactly these members. A name that Python forbids ends in `_` in the class."""

    model_config = ConfigDict(extra="forbid", alias_generator=lambda name: name.rstrip("_"))


def describe_json(*models: type) -> Described:
    """Describe an answer that is one of these documents."""
    return {200: {"model": reduce(or_, models), "description": "JSON"}}


def describe_bytes(media_type: str, description: str) -> Described:
    """Describe an answer of bytes."""
    schema = {"type": "string", "format": "binary"}
    return {200: {"description": description, "content": {media_type: {"schema": schema}}}}
