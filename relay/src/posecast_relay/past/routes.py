"""The HTTP routes of the past: how far back the caller may look, the indexes, and the segments.

Each request goes through the same admission as a live viewer. Segments use ASGI like any other response,
not the raw transport that streams use: they end, so the usual bounds on requests and unread bytes and keep-
alive apply to them.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Awaitable, Callable
from functools import wraps
from http import HTTPStatus
from typing import Any, NoReturn, TypeVar

from fastapi import FastAPI, HTTPException, Request, Response

from posecast_relay.auth.access import Access
from posecast_relay.core.policy import HIDDEN, Grant, find_past_window
from posecast_relay.net.answer_cache import Described, describe_json, send_named
from posecast_relay.net.request import OPEN, require_grant
from posecast_relay.past import documents
from posecast_relay.past.address import (
    AddressError,
    PastSpan,
    read_after,
    read_every,
    read_index,
    read_page,
    read_sha256,
    read_span,
    read_take,
)
from posecast_relay.past.reading import NotYet
from posecast_relay.past.segment import KeptSegment, SegmentName
from posecast_relay.past.service import Found, PastService, ShownPage
from posecast_relay.past.source import PastAway

NO_STORE = {"cache-control": "private, no-store"}
# headers that pages of other origins may read
READABLE = {"access-control-expose-headers": "age, date, etag, retry-ms, retry-after"}
FOR_A_SECOND = READABLE | {"cache-control": "public, max-age=1", "vary": "authorization"}
# Statuses that may pass: a blackout, a robot that is not there yet, Redis away. Also malformed addresses;
# the response to one that contains a token is already marked as not cacheable.
SAME_FOR_ALL = frozenset((400, 403, 404, 501, 503))


def set_cache_headers(route: Callable[..., Awaitable[Response]]) -> Callable[..., Awaitable[Response]]:
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


T = TypeVar("T")

HOLD_S = 8.0  # how long a request for the next segment waits
RETRY_MS = 1000  # when to ask again for a segment that does not exist yet
FRESH_S_MAX = 3600.0  # the longest cache lifetime, so that revoked data is gone within an hour
LIST_SHARED_S = 10.0  # of a list in a shared cache: browsers ask for it anew each time, and so see a deletion
CLOSED_MS = 10_000  # after its end a page gets no more segments: each lasts at most 6 s
NOT_KEPT = "this process keeps no past: ask a relay that was started with --past memory:"
NO_ROUTE = (
    "no such route: below past there are VIEW/DAY, VIEW/MINUTES, VIEW/MINUTES/keys, VIEW/TAKE/INDEX and "
    "VIEW/schema/SHA256, with a VIEW as public, a DAY as 2026-11-22, ten MINUTES as 2026-11-22T14:20Z"
)
BUSY = READABLE | {"retry-after": "1"}
BINARY = "application/octet-stream"
HAD: Described = {304: {"description": "Not modified: your copy is current"}}
ERRORS: Described = {
    400: {"description": "The address is malformed, or contains a token"},
    401: {"description": "The token is wrong or has expired"},
    403: {"description": "You may not see this view, or a token came from a page of another origin"},
    404: {"description": "Not found, or you may not see it"},
    503: {"description": "The store of the past or the account service does not answer: retry"},
}
BELOW = ERRORS | {501: {"description": "This process keeps no past"}}
KEYS: Described = HAD | {
    503: {
        "description": "The store does not answer, or too many of these pages are requested at once: retry"
    },
    200: {
        "description": "A page of KEYs (SPEC §11)",
        "content": {BINARY: {"schema": {"type": "string", "format": "binary"}}},
    },
}
HELD: Described = HAD | {
    200: {
        "description": "The segment; or JSON that names the next one, if this is hidden or its take is over",
        "model": documents.NextSegment,
        "content": {BINARY: {"schema": {"type": "string", "format": "binary"}}},
    },
    204: {"description": "It does not exist yet: retry after `retry-ms`"},
}


def add_past_routes(app: FastAPI, api: str, access: Access, service: PastService | None) -> None:
    """Add the routes below `{api}/{robot}/past`. `service` None: this process keeps no past."""
    api += "/{robot}/past"

    @app.get(
        api,
        summary="How far back you may look",
        responses=ERRORS | HAD | describe_json(documents.PastSummary),
    )
    @set_cache_headers
    async def past(request: Request, robot: str, view: str | None = None) -> Response:
        if service is None:
            return await _answer_no_past(access, request, robot, view)
        grant, at = await _enter(access, service, request, robot, view)

        async def load() -> bytes:
            return documents.make_summary(grant, await _wait(at.find_extent(grant)))

        return await at.answers.load_answer(request, _key(grant, "past"), load, _share(grant, 1.0))

    @app.get(
        api + "/{view}/schema/{sha256}",
        summary="The text of a schema that a segment names",
        response_model=dict[str, Any],
        responses=BELOW | HAD,
    )
    @set_cache_headers
    async def schema(request: Request, robot: str, view: str, sha256: str) -> Response:
        grant, at = await _enter(access, service, request, robot, view)
        found = await _wait(at.find_schema(grant, _read(read_sha256, sha256)))
        if found is None:
            _refuse(grant, "no such schema in the part of the past that you may see")
        text, from_ms = found
        left_s = find_past_window(grant, at.compute_unix_ms()).compute_left_s(from_ms)
        return _send(request, text.encode(), "application/json", sha256, _share(grant, left_s))

    @app.get(
        api + "/{view}/{span}",
        summary="A day by minutes (2026-11-22), or the index of ten minutes (2026-11-22T14:20Z)",
        responses=BELOW | HAD | describe_json(documents.PastPage, documents.PastDay),
    )
    @set_cache_headers
    async def index(request: Request, robot: str, view: str, span: str, after: str | None = None) -> Response:
        grant, at = await _enter(access, service, request, robot, view)
        asked = _read(read_span, span)
        if asked.is_day:
            return await _send_day(request, at, grant, asked, span)
        since = None if after is None else _read(read_after, after)
        page = await _wait(at.list_page(grant, asked))
        headers = _share(grant, 1.0, _compute_page_s(grant, asked, page, at.compute_unix_ms()))
        made = lambda: documents.make_page(view, asked, _list_after(page.segments, since))  # noqa: E731
        return at.answers.get_answer(request, _key(grant, f"{span}?{after}"), made, headers)

    @app.get(
        api + "/{view}/{page}/keys",
        summary="The first pose of every n-th segment of ten minutes; `every` above 150 counts as 150",
        response_class=Response,
        responses=BELOW | KEYS,
    )
    @set_cache_headers
    async def key_page(request: Request, robot: str, view: str, page: str, every: str = "1") -> Response:
        grant, at = await _enter(access, service, request, robot, view)
        asked, step = _read(read_page, page), _read(read_every, every)
        found = await _wait(at.list_page(grant, asked))
        shown = found.segments
        body = await _make_key_page(at, grant, asked, shown, step)
        headers = _share(grant, 1.0, _compute_page_s(grant, asked, found, at.compute_unix_ms()))
        return _send(request, body, BINARY, hashlib.sha256(body).hexdigest()[:16], headers)

    @app.get(
        api + "/{view}/{take}/{index}",
        summary="A segment; a request for the next one waits until it exists",
        response_class=Response,
        responses=BELOW | HELD,
    )
    @set_cache_headers
    async def segment(request: Request, robot: str, view: str, take: str, index: str) -> Response:
        grant, at = await _enter(access, service, request, robot, view)
        name = _read(read_take, take), _read(read_index, index)
        found = await _find(at, grant, name)
        if isinstance(found, NotYet) and request.method == "GET":
            with at.held.hold() as may_wait:
                until_s, waits = access.live.now() + HOLD_S, may_wait
                while waits and isinstance(found, NotYet):
                    waits = await _hold(at, grant, name, access.live.now, until_s)
                    grant, at = await _enter(access, service, request, robot, view)  # it may have changed
                    found = await _wait(at.find_segment(grant, *name))
        return _answer(request, at, grant, found)

    _refuse_others(app, api)


async def _make_key_page(
    service: PastService, grant: Grant, page: PastSpan, shown: list[KeptSegment], every: int
) -> bytes:
    """Return a page of KEYs. Raises HTTPException 503."""
    body = await _wait(service.keys.make_page(grant, page.from_ms, shown, every, service.source.load))
    if any(map(service.deletions.cover_segment, shown)):  # deleted while the page was made
        service.keys.forget(grant.robot)
        raise HTTPException(503, "a deletion changed this page while it was made: retry", BUSY)
    if body is None:
        raise HTTPException(503, "this relay is making as many pages of KEYs as it can: retry", BUSY)
    return body


def _refuse_others(app: FastAPI, api: str) -> None:
    @app.get(api + "/{_rest:path}", include_in_schema=False)
    @set_cache_headers
    async def no_such_route(request: Request, _rest: str) -> Response:  # noqa: ARG001
        raise HTTPException(HTTPStatus.NOT_FOUND, NO_ROUTE)


async def _answer_no_past(access: Access, request: Request, robot: str, view: str | None) -> Response:
    """Answer that nobody may look back. Not an error status: browsers would log that on every page."""
    grant = await require_grant(access, request, robot, view)
    return Response(documents.make_no_summary(grant), media_type="application/json", headers=NO_STORE)


async def _enter(
    access: Access, service: PastService | None, request: Request, robot: str, view: str | None
) -> tuple[Grant, PastService]:
    """Return what the caller may see, and where the past is read. Raises HTTPException."""
    grant = await require_grant(access, request, robot, view)
    if service is None:
        raise HTTPException(HTTPStatus.NOT_IMPLEMENTED, NOT_KEPT)
    await _wait(service.source.refresh(grant.robot, grant.view))
    await access.live.open_robot(grant.robot)
    if access.find_robot(grant) is None and not await _wait(service.has_any(grant)):
        raise HTTPException(HTTPStatus.NOT_FOUND, HIDDEN)
    return grant, service


async def _send_day(
    request: Request, service: PastService, grant: Grant, day: PastSpan, text: str
) -> Response:
    """Send a day by minutes. Raises HTTPException 503."""

    async def load() -> bytes:
        return documents.make_day(grant.view, day, await _wait(service.list_minutes(grant, day)))

    return await service.answers.load_answer(request, _key(grant, text), load, _share(grant, 1.0))


async def _find(service: PastService, grant: Grant, name: tuple[int, int]) -> Found:
    """Return a segment, or what to send instead. Raises HTTPException 503.

    Another gateway may have announced a name that this one does not know yet, so it looks again once.
    """
    found = await _wait(service.find_segment(grant, *name))
    if found is None and grant.past_s > 0:
        await _wait(service.source.refresh(grant.robot, grant.view, anew=True))
        found = await _wait(service.find_segment(grant, *name))
    return found


async def _hold(
    service: PastService, grant: Grant, name: tuple[int, int], now: Callable[[], float], until_s: float
) -> bool:
    """Wait until a segment may exist or the rules change, at most until `until_s`, in seconds of `now`.

    Returns False if there is nothing to wait for. Raises HTTPException 503.
    """
    rules, has_waited = service.policy, False
    while (left_s := until_s - now()) > 0 and service.policy is rules:
        unix_ms = service.compute_unix_ms()
        found = service.reader.find_segment(grant, *name, unix_ms)
        if not isinstance(found, NotYet):
            return has_waited
        if found.due_ms is not None:
            left_s = min(left_s, (found.due_ms - unix_ms + 1) / 1000)
        if not await service.held.wait(grant.robot, grant.view, left_s):
            return False
        has_waited = True
        await _wait(service.source.refresh(grant.robot, grant.view))
    return left_s > 0


def _answer(request: Request, service: PastService, grant: Grant, found: Found) -> Response:
    """Send a segment, or what replaces it. Raises HTTPException 404."""
    answers = service.held.answers
    if found is None:
        answers["none"] += 1
        _refuse(grant, "no such segment in the part of the past that you may see")
    if isinstance(found, NotYet):
        answers["not yet"] += 1
        headers = _share(grant, 1.0) | {"retry-ms": f"{RETRY_MS}"}
        return Response(status_code=HTTPStatus.NO_CONTENT, headers=headers)
    if isinstance(found, SegmentName):
        answers["next"] += 1
        body, headers = documents.make_next(found), _share(grant, 1.0)
        return Response(body, headers=headers, media_type="application/json")
    answers["segment"] += 1
    window = find_past_window(grant, service.compute_unix_ms())
    headers = _share(grant, window.compute_left_s(found.from_ms))
    return _send(request, found.data, BINARY, found.sha256.hex(), headers)


async def _wait(asked: Awaitable[T]) -> T:
    """Wait for the source of the past. Raises HTTPException 503 if it can't be read right now."""
    try:
        return await asked
    except PastAway as e:
        raise HTTPException(HTTPStatus.SERVICE_UNAVAILABLE, str(e), BUSY) from None


def _read(read: Callable[[str], T], text: str) -> T:
    try:
        return read(text)
    except AddressError as e:
        raise HTTPException(HTTPStatus.BAD_REQUEST, str(e)) from None


def _refuse(grant: Grant, reason: str) -> NoReturn:
    """Answer 404, with a retry after one second at the earliest."""
    raise HTTPException(HTTPStatus.NOT_FOUND, reason, _share(grant, 1.0))


def _share(grant: Grant, fresh_s: float, shared_s: float = 0.0) -> dict[str, str]:
    """Make the headers that say who may read a response and how long caches may keep it; `shared_s`: caches
    for many, if longer.

    The lifetime is at least one second while the request can repeat: without it, every viewer of a crowd
    would reach the relay.
    """
    if not grant.open:
        return NO_STORE
    kept_s = max(1, math.floor(min(fresh_s, FRESH_S_MAX)))
    shared = f", s-maxage={math.floor(shared_s)}" if shared_s >= kept_s + 1 else ""
    return OPEN | READABLE | {"cache-control": f"public, max-age={kept_s}{shared}"}


def _send(request: Request, body: bytes, type_: str, name: str, headers: dict[str, str]) -> Response:
    """Send immutable bytes named `name`; 304 if the caller already has them."""
    headers = headers | {"etag": f'"{name}"', "x-content-type-options": "nosniff"}
    return send_named(request, body, type_, headers)


def _key(grant: Grant, what: str) -> str:
    """Name a response: callers with the same name get the same bytes."""
    return f"{grant.robot}/{grant.view}/{grant.by}/{grant.delay_s:g}/{grant.past_s:g}/{what}"


def _list_after(shown: list[KeptSegment], since: tuple[int, int] | None) -> list[KeptSegment]:
    """Return the segments after `since`. If it is not in the list, return those after the newest earlier one
    of its take; if there is none of those either, return them all.
    """
    if since is None:
        return shown
    take, index = since
    upto = [n for n, each in enumerate(shown) if each.name.take == take and each.name.index <= index]
    newest = max(upto, key=lambda n: shown[n].name.index, default=-1)
    return shown[newest + 1 :]


def _compute_page_s(grant: Grant, page: PastSpan, found: ShownPage, unix_ms: int) -> float:
    """Return how long a cache for many may keep the index of ten minutes, in seconds."""
    window = find_past_window(grant, unix_ms)
    if not found.segments or not found.is_whole or window.to_ms < page.to_ms + CLOSED_MS:
        return 1.0
    return min(LIST_SHARED_S, *(window.compute_left_s(segment.from_ms) for segment in found.segments))
