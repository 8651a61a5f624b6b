"""The HTTP routes: the list of robots, their state as JSON, models, health, and the page."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path

from fastapi import FastAPI, HTTPException, Request, Response
from fastapi.responses import JSONResponse, PlainTextResponse
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException as StarletteHTTPException

from posecast_relay.auth.access import Access
from posecast_relay.core.messages import describe_pong
from posecast_relay.core.policy import ANYONE, HIDDEN, Grant
from posecast_relay.http.admin.routes import AdminSources, add_admin_routes
from posecast_relay.http.answers import (
    ErrorAnswer,
    OEmbed,
    PongAnswer,
    Readiness,
    RobotDetails,
    RobotList,
    RobotState,
)
from posecast_relay.http.models import GzipCache, make_model_answer
from posecast_relay.http.previews import FRAME_PX, LinkPreview, Thumbnails
from posecast_relay.http.robots import StateReader, make_robot_document, make_robots_document
from posecast_relay.http.static import Guide, KeptFiles, Page
from posecast_relay.models.cache import Absent, ModelCache, ModelFile, Unavailable
from posecast_relay.net.answer_cache import AnswerCache, Described, describe_bytes
from posecast_relay.net.encodings import DecodeCache
from posecast_relay.net.request import (
    OPEN,
    identify_asker,
    is_on_this_machine,
    make_sharing_headers,
    require_grant,
)
from posecast_relay.past.routes import add_past_routes
from posecast_relay.past.service import PastService
from posecast_relay.past.source import PastAway
from posecast_relay.runtime.dispatcher import Dispatcher

NO_PAGE = """The relay is running, but it has no page to show. Start it with --static DIR, the built page
(in a checkout spa/dist, which `make setup` builds). The API is described at /openapi.json
"""
API = "/api/v1/robots"
GUIDE = "/guide"  # also the name of its folder in the built page
PICTURE_FRESH = "public, max-age=60"
OLD_MODEL_FRESH = "public, max-age=3600"
EVENTS: Described = {
    200: {
        "description": "Server-sent events: the messages of the stream, frames in base64 (wire/SPEC.md §6)",
        "content": {"text/event-stream": {"schema": {"type": "string"}}},
    }
}
ALIVE: Described = {200: {"description": "`ok`", "content": {"text/plain": {"schema": {"type": "string"}}}}}
MODEL = describe_bytes("*/*", "manifest.json, or a file that it names, in that file's own type")
PREFLIGHT = OPEN | {
    "access-control-allow-methods": "GET, OPTIONS",
    "access-control-allow-headers": "authorization, if-none-match, last-event-id",
    "access-control-max-age": "86400",
}


def make_app(
    access: Access,
    models: ModelCache,
    decoded: DecodeCache,
    page: Path | None,
    public_url: str | None = None,
    publish_at: str | None = None,
    past: PastService | None = None,
    find_config_trouble: Callable[[], str | None] = lambda: None,
    admin: AdminSources | None = None,
) -> FastAPI:
    """Make the relay's HTTP application. WebSocket upgrades never reach it.

    `page`: the folder of the built page; None without one.
    `public_url`: where people open the page, without a slash at its end; None if it is not set.
    `publish_at`: where programs on this machine can publish without a credential; None if they can't.
    `past`: the past that this process serves; None without one.
    `find_config_trouble` returns which configuration files are invalid.
    `admin`: what the page `/admin` shows; None without a robots file, which has its credential.
    """
    # FastAPI's /docs loads scripts from another origin; the built page has its own copy (spa/public/docs).
    # The default answer replaces FastAPI's 422, which never occurs: all parameters are texts that we parse.
    app = FastAPI(
        title="Posecast relay",
        version="1",
        docs_url=None,
        redoc_url=None,
        responses={"default": {"description": "Refused; `error` tells why", "model": ErrorAnswer}},
    )

    @app.exception_handler(StarletteHTTPException)
    async def refused(_request: Request, error: StarletteHTTPException) -> JSONResponse:
        return JSONResponse({"error": error.detail}, error.status_code, dict(error.headers or {}) | OPEN)

    _add_robots(app, access, decoded, publish_at)

    @app.get(
        API + "/{robot}/live.sse",
        summary="Stream the state as server-sent events: hz, view, format=json",
        response_class=Response,
        responses=EVENTS,
    )
    async def events(request: Request, robot: str) -> Response:  # noqa: ARG001 — served below ASGI, mostly
        if request.method == "HEAD":
            raise HTTPException(405, "use GET for a stream", {"allow": "GET"})
        raise HTTPException(400, "a stream can't start before the connection's previous answer has ended")

    @app.get("/api/v1/ping", summary="The relay's clock: t is sent back", response_model=PongAnswer)
    async def ping(t: str = "0") -> JSONResponse:
        try:
            pong = describe_pong(float(t), access.live.now())
            return JSONResponse(pong, headers=OPEN | {"cache-control": "no-store"})
        except ValueError:  # also for a number that JSON does not have
            raise HTTPException(400, "t: not a number") from None

    @app.options("/api/{_rest:path}", include_in_schema=False)
    async def preflight(_rest: str) -> Response:
        return Response(status_code=204, headers=PREFLIGHT)

    if past is not None:
        access.on_policy(past.set_policy)
    add_past_routes(app, API, access, past)
    _add_models(app, access, models, past)
    thumbnails = Thumbnails(models)
    preview = LinkPreview(access, thumbnails, public_url)
    _add_previews(app, access, models, thumbnails, preview)
    find_trouble = partial(_find_trouble, access.live, past, find_config_trouble)
    _add_health(app, access.live, find_trouble)

    if admin is not None:
        add_admin_routes(app, access, admin, find_trouble)

    @app.get("/api/{_rest:path}", include_in_schema=False)
    async def no_such_route(_rest: str) -> Response:
        raise HTTPException(404, "no such route")

    for route in [each for each in app.routes if isinstance(each, APIRoute) and each.methods == {"GET"}]:
        app.add_api_route(route.path, route.endpoint, methods=["HEAD"], include_in_schema=False)

    if page is not None:
        kept = KeptFiles()
        app.mount(GUIDE, Guide(page / GUIDE[1:], kept))
        app.mount("/", Page(page, kept, access.list_frame_ancestors, preview))
    else:

        @app.get("/", include_in_schema=False)
        async def no_page() -> PlainTextResponse:
            return PlainTextResponse(NO_PAGE, 404)

    return app


def _find_trouble(
    dispatcher: Dispatcher, past: PastService | None, find_config_trouble: Callable[[], str | None]
) -> str | None:
    """Return why the relay is degraded, in one line that anybody may read; None if it is not."""
    live, past_ = dispatcher.store.find_trouble(), None if past is None else past.source.find_trouble()
    whys = (find_config_trouble(), live, past_ and f"the past: {past_}")
    return "; ".join(filter(None, whys)) or None


def _add_health(app: FastAPI, dispatcher: Dispatcher, find_trouble: Callable[[], str | None]) -> None:
    @app.get("/livez", summary="Whether the process is alive", response_class=Response, responses=ALIVE)
    async def livez() -> PlainTextResponse:
        return PlainTextResponse("ok\n")

    @app.get(
        "/readyz",
        summary="Whether viewers are accepted; `degraded` if the store or the past is unavailable, "
        "a configuration file is invalid or not in force, or robots can't connect",
        response_model=Readiness,
    )
    async def readyz() -> JSONResponse:
        if dispatcher.draining:
            return JSONResponse({"status": "draining"}, 503)
        why = find_trouble()
        return JSONResponse({"status": "degraded", "why": why} if why else {"status": "ready"})


def _add_robots(app: FastAPI, access: Access, decoded: DecodeCache, publish_at: str | None) -> None:
    dispatcher = access.live
    answers = AnswerCache(dispatcher.now)
    reader = StateReader(dispatcher.now, decoded)

    @app.get(API, summary="List the robots", response_model=RobotList)
    async def robots(request: Request) -> Response:
        who = await identify_asker(access, request)
        here = publish_at if is_on_this_machine(access, request) else None
        made = partial(make_robots_document, access, who, dispatcher.now(), here)
        headers = make_sharing_headers(request, who is ANYONE)
        if publish_at is not None:
            headers = headers | {"vary": "origin"}
        name = f"{who.audience}/{who.robot}/{'' if here is None else 'here'}"
        return answers.get_answer(request, name, made, headers)

    @app.get(
        API + "/{robot}", summary="One robot: liveness, viewers, schema, model", response_model=RobotDetails
    )
    async def one_robot(request: Request, robot: str) -> Response:
        grant = await require_grant(access, request, robot)
        await dispatcher.open_robot(robot)
        found = access.find_robot(grant)
        if found is None:
            raise HTTPException(404, HIDDEN)
        made = partial(make_robot_document, access, grant, *found, dispatcher.now())
        name = f"{robot}/{grant.view}/{grant.delay_s:g}"
        return answers.get_answer(request, name, made, make_sharing_headers(request, grant.open))

    @app.get(
        API + "/{robot}/state", summary="The newest state with names and units", response_model=RobotState
    )
    async def state(request: Request, robot: str, view: str | None = None) -> Response:
        grant = await require_grant(access, request, robot, view)
        await dispatcher.open_robot(robot)
        of, room = access.find_robot(grant) or (None, None)
        if of is None or room is None or room.stream.newest is None:
            raise HTTPException(404, HIDDEN)
        body = reader.read(of, room, grant.hz)
        headers = {"cache-control": "no-cache"} | make_sharing_headers(request, grant.open)
        return Response(body, media_type="application/json", headers=headers)


def _add_models(app: FastAPI, access: Access, models: ModelCache, past: PastService | None) -> None:
    packed = GzipCache(models.room)

    @app.get(
        API + "/{robot}/model/{digest}/{path:path}",
        summary="A file of a robot's model; its list is manifest.json",
        response_class=Response,
        responses=MODEL,
    )
    async def model(request: Request, robot: str, digest: str, path: str) -> Response:
        grant = await require_grant(access, request, robot)
        is_old = past is not None and past.has_models and not await _announces(access, grant, digest)
        if past is not None and is_old and not await _shows_model(past, grant, digest):
            raise HTTPException(404, "no such model")
        if path == "manifest.json":
            found = await _load(models.load_manifest(robot, digest))
        else:
            found = await _load(models.load_file(robot, digest, path))
        answer = await make_model_answer(request, models, packed, robot, found)
        # an old one is kept only as long as a past refers to it
        return _share_file(answer, request, grant, OLD_MODEL_FRESH if is_old else None)


def _share_file(answer: Response, request: Request, grant: Grant, fresh: str | None) -> Response:
    """Set who may read a model's file. `fresh`: for how long; None: for ever."""
    if fresh is not None:
        answer.headers["cache-control"] = fresh
    if not grant.open:
        del answer.headers["access-control-allow-origin"]
        answer.headers.update(make_sharing_headers(request, False))
    return answer


async def _announces(access: Access, grant: Grant, digest: str) -> bool:
    """Whether a robot has this model now, either live or with this client's delay."""
    await access.live.open_robot(grant.robot)
    of = access.live.hub.robots.get(grant.robot)
    rooms = () if of is None else tuple(of.rooms.values())
    _, own = access.find_robot(grant) or (None, None)  # with the grant's delay, if any
    return any(room is not None and room.stream.model == digest for room in (*rooms, own))


async def _shows_model(past: PastService, grant: Grant, digest: str) -> bool:
    """Whether the client may see a past that refers to this model. Raises HTTPException 503."""
    try:
        await past.source.refresh(grant.robot, grant.view)
        return await past.shows_model(grant, digest)
    except PastAway as e:
        raise HTTPException(503, str(e), {"retry-after": "1"}) from None


def _add_previews(
    app: FastAPI, access: Access, models: ModelCache, thumbnails: Thumbnails, preview: LinkPreview
) -> None:
    packed = GzipCache(models.room)

    @app.get(
        API + "/{robot}/picture",
        summary="A small picture of the robot, from its present model",
        response_class=Response,
        responses=describe_bytes("image/*", "PNG, JPEG or WebP"),
    )
    async def picture(request: Request, robot: str) -> Response:
        grant = await require_grant(access, request, robot)
        await access.live.open_robot(robot)
        _, room = access.find_robot(grant) or (None, None)
        if room is None or room.stream.model is None:
            raise HTTPException(404, HIDDEN)
        found = await _load(thumbnails.load_picture(robot, room.stream.model))
        answer = await make_model_answer(request, models, packed, robot, found)
        return _share_file(answer, request, grant, PICTURE_FRESH)

    @app.get(
        "/api/v1/oembed",
        summary="oEmbed for a robot's page: url, maxwidth, maxheight, format=json",
        response_model=OEmbed,
    )
    async def oembed(
        url: str = "",
        maxwidth: str = "",
        maxheight: str = "",
        format: str = "json",
    ) -> JSONResponse:
        if not url:
            raise HTTPException(400, "give url=, the address of a robot's page")
        if format != "json":
            raise HTTPException(501, "format: only json is supported")
        answer = await preview.make_oembed(url, (_read_px(maxwidth), _read_px(maxheight)))
        if answer is None:
            raise HTTPException(404, HIDDEN)
        return JSONResponse(answer, headers=OPEN)


async def _load(fetching: Awaitable[ModelFile]) -> ModelFile:
    """Wait for a model's file. Raises HTTPException 404 or 503 if it can't be had."""
    try:
        return await fetching
    except Absent as e:
        raise HTTPException(404, str(e)) from None
    except Unavailable as e:
        raise HTTPException(503, str(e), {"retry-after": f"{math.ceil(e.retry_s)}"}) from None


def _read_px(text: str) -> int:
    """Parse a length in pixels; an invalid one is treated like a missing one."""
    return int(text) if text.isascii() and text.isdigit() and len(text) < 6 else FRAME_PX
