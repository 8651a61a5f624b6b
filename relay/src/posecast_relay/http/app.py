"""The HTTP routes: the list of robots, their state as JSON, models, health, and the page."""

from __future__ import annotations

import hashlib
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path

from fastapi import FastAPI, HTTPException, Request, Response
from fastapi.responses import JSONResponse, PlainTextResponse
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException as StarletteHTTPException

from posecast_relay.auth.access import Access
from posecast_relay.core.policy.admission import HIDDEN
from posecast_relay.core.policy.policy import ANYONE
from posecast_relay.http.auth import OPEN, identify_asker, make_sharing_headers, require_grant
from posecast_relay.http.gzip_cache import GzipCache
from posecast_relay.http.link_preview import FRAME_PX, LinkPreview
from posecast_relay.http.models import make_model_answer
from posecast_relay.http.robot_state import StateReader
from posecast_relay.http.robots import make_robot_document, make_robots_document
from posecast_relay.http.static_page import Page
from posecast_relay.http.thumbnails import Thumbnails
from posecast_relay.models.cache import Absent, ModelCache, ModelFile, Unavailable
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.streaming.decode_cache import DecodeCache

NO_PAGE = """The relay serves, but it has no page to show: start it with --static DIR, the built page
(in a checkout spa/dist, which `make setup` builds). The API is described in /openapi.json
"""
PACKED_PAGE = Path(__file__).parent.parent / "page"  # the built page, where the wheel carries it
API = "/api/v1/robots"
PICTURE_FRESH = "public, max-age=60"
FRESH_S = 1.0  # answers are this old at most
ANSWERS_MAX = 256
ANSWERS_BYTES = 8 << 20
PREFLIGHT = OPEN | {
    "access-control-allow-methods": "GET, OPTIONS",
    "access-control-allow-headers": "authorization, if-none-match, last-event-id",
    "access-control-max-age": "86400",
}


class AnswerCache:
    """Caches JSON answers with an ETag: each is made at most once a second, however many ask."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._made: dict[str, tuple[float, bytes, str]] = {}
        self._bytes = 0

    def get_answer(
        self, request: Request, name: str, make: Callable[[], bytes], more: dict[str, str]
    ) -> Response:
        """Return the answer called `name`, or 304 when the asker has it already. `more`: further headers."""
        now = self._now()
        made = self._made.get(name)
        if made is None or now - made[0] >= FRESH_S:
            body = make()
            made = (now, body, f'"{hashlib.sha256(body).hexdigest()[:16]}"')
            self._keep(name, made)
        _, body, etag = made
        headers = {"etag": etag, "cache-control": "public, max-age=1"} | more
        if etag in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        return Response(body, media_type="application/json", headers=headers)

    def _keep(self, name: str, made: tuple[float, bytes, str]) -> None:
        before = self._made.pop(name, None)
        self._bytes += len(made[1]) - (len(before[1]) if before is not None else 0)
        if self._bytes > ANSWERS_BYTES or len(self._made) >= ANSWERS_MAX:
            self._made.clear()
            self._bytes = len(made[1])
        self._made[name] = made


def make_app(
    access: Access,
    models: ModelCache,
    decoded: DecodeCache,
    static: Path | None,
    public_url: str | None = None,
    publish_at: str | None = None,
) -> FastAPI:
    """Make the relay's HTTP application. WebSocket upgrades never reach it.

    `public_url`: where people open the page, without a slash at its end; None when nobody has said so.
    `publish_at`: where anybody on this machine may publish; None when nobody may without a credential.
    """
    # FastAPI's own /docs loads its scripts from another origin; the built page brings them (spa/public/docs)
    app = FastAPI(title="Posecast relay", version="1", docs_url=None, redoc_url=None)

    @app.exception_handler(StarletteHTTPException)
    async def refused(_request: Request, error: StarletteHTTPException) -> JSONResponse:
        return JSONResponse({"error": error.detail}, error.status_code, dict(error.headers or {}) | OPEN)

    _add_robots(app, access, decoded, publish_at)

    @app.get(
        API + "/{robot}/live.sse",
        summary="The stream as events: hz, view, format=json, preview=1",
    )
    async def events(request: Request, robot: str) -> Response:  # noqa: ARG001 — served below ASGI, mostly
        if request.method == "HEAD":
            raise HTTPException(405, "a stream is read by GET", {"allow": "GET"})
        raise HTTPException(400, "events on a connection that is still answering")

    @app.options("/api/{_rest:path}", include_in_schema=False)
    async def preflight(_rest: str) -> Response:
        return Response(status_code=204, headers=PREFLIGHT)

    _add_models(app, access, models)
    preview = LinkPreview(access, public_url)
    _add_previews(app, access, models, preview)
    _add_health(app, access.live)

    @app.get("/api/{_rest:path}", include_in_schema=False)
    async def no_such_route(_rest: str) -> Response:
        raise HTTPException(404, "no such route")

    for route in [each for each in app.routes if isinstance(each, APIRoute) and each.methods == {"GET"}]:
        app.add_api_route(route.path, route.endpoint, methods=["HEAD"], include_in_schema=False)

    page = static or (PACKED_PAGE if (PACKED_PAGE / "index.html").is_file() else None)
    if page is not None:
        app.mount("/", Page(page, access.list_frame_ancestors, preview))
    else:

        @app.get("/", include_in_schema=False)
        async def no_page() -> PlainTextResponse:
            return PlainTextResponse(NO_PAGE, 404)

    return app


def _add_health(app: FastAPI, dispatcher: Dispatcher) -> None:
    @app.get("/livez", summary="The process answers")
    async def livez() -> PlainTextResponse:
        return PlainTextResponse("ok\n")

    @app.get("/readyz", summary="Whether viewers are accepted; `degraded` when the store is not there")
    async def readyz() -> JSONResponse:
        trouble = dispatcher.store.find_trouble()
        if dispatcher.draining:
            return JSONResponse({"status": "draining"}, 503)
        return JSONResponse({"status": "degraded", "why": trouble} if trouble else {"status": "ready"})


def _add_robots(app: FastAPI, access: Access, decoded: DecodeCache, publish_at: str | None) -> None:
    dispatcher = access.live
    answers = AnswerCache(dispatcher.now)
    reader = StateReader(dispatcher.now, decoded)

    @app.get(API, summary="Robots on air")
    async def robots(request: Request) -> Response:
        who = await identify_asker(access, request)
        made = partial(make_robots_document, access, who, dispatcher.now(), publish_at)
        headers = make_sharing_headers(request, who is ANYONE)
        return answers.get_answer(request, f"{who.audience}/{who.robot}", made, headers)

    @app.get(API + "/{robot}", summary="One robot: liveness, viewers, schema, model")
    async def one_robot(request: Request, robot: str) -> Response:
        grant = await require_grant(access, request, robot)
        await dispatcher.open_robot(robot)
        found = access.find_robot(grant)
        if found is None:
            raise HTTPException(404, HIDDEN)
        made = partial(make_robot_document, access, grant, *found, dispatcher.now())
        name = f"{robot}/{grant.view}/{grant.delay_s:g}"
        return answers.get_answer(request, name, made, make_sharing_headers(request, grant.open))

    @app.get(API + "/{robot}/state", summary="The newest state with names and units")
    async def state(request: Request, robot: str, view: str | None = None) -> Response:
        grant = await require_grant(access, request, robot, view)
        await dispatcher.open_robot(robot)
        of, room = access.find_robot(grant) or (None, None)
        if of is None or room is None or room.stream.newest is None:
            raise HTTPException(404, HIDDEN)
        body = reader.read(of, room, grant.hz)
        headers = {"cache-control": "no-cache"} | make_sharing_headers(request, grant.open)
        return Response(body, media_type="application/json", headers=headers)


def _add_models(app: FastAPI, access: Access, models: ModelCache) -> None:
    packed = GzipCache(models.room)

    @app.get(API + "/{robot}/model/{digest}/{path:path}", summary="A model's manifest.json and files")
    async def model(request: Request, robot: str, digest: str, path: str) -> Response:
        grant = await require_grant(access, request, robot)
        if path == "manifest.json":
            found = await _load(models.load_manifest(robot, digest))
        else:
            found = await _load(models.load_file(robot, digest, path))
        answer = await make_model_answer(request, models, packed, robot, found)
        if not grant.open:
            del answer.headers["access-control-allow-origin"]
            answer.headers.update(make_sharing_headers(request, False))
        return answer


def _add_previews(app: FastAPI, access: Access, models: ModelCache, preview: LinkPreview) -> None:
    packed, thumbnails = GzipCache(models.room), Thumbnails(models)

    @app.get(API + "/{robot}/picture", summary="A small picture of the robot, as its model has it now")
    async def picture(request: Request, robot: str) -> Response:
        grant = await require_grant(access, request, robot)
        await access.live.open_robot(robot)
        _, room = access.find_robot(grant) or (None, None)
        if room is None or room.stream.model is None:
            raise HTTPException(404, HIDDEN)
        found = await _load(thumbnails.load_picture(robot, room.stream.model))
        answer = await make_model_answer(request, models, packed, robot, found)
        answer.headers["cache-control"] = PICTURE_FRESH
        if not grant.open:
            del answer.headers["access-control-allow-origin"]
            answer.headers.update(make_sharing_headers(request, False))
        return answer

    @app.get("/api/v1/oembed", summary="oEmbed of a robot's page: url, maxwidth, maxheight, format=json")
    async def oembed(
        url: str,
        maxwidth: str = "",
        maxheight: str = "",
        format: str = "json",
    ) -> JSONResponse:
        if format != "json":
            raise HTTPException(501, "only format=json")
        answer = preview.make_oembed(url, (_read_px(maxwidth), _read_px(maxheight)))
        if answer is None:
            raise HTTPException(404, HIDDEN)
        return JSONResponse(answer, headers=OPEN)


async def _load(fetching: Awaitable[ModelFile]) -> ModelFile:
    """Wait for a model's file. Raises HTTPException 404 or 503 without it."""
    try:
        return await fetching
    except Absent as e:
        raise HTTPException(404, str(e)) from None
    except Unavailable as e:
        raise HTTPException(503, str(e), {"retry-after": "5"}) from None


def _read_px(text: str) -> int:
    """Read a length in pixels; what is none is as none said."""
    return int(text) if text.isascii() and text.isdigit() and len(text) < 6 else FRAME_PX
