"""HTTP: what is on air, the state as plain JSON, models, health, and the page."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fastapi import FastAPI, HTTPException, Request, Response
from fastapi.responses import JSONResponse, PlainTextResponse
from fastapi.staticfiles import StaticFiles
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException as StarletteHTTPException
from starlette.types import Scope

from posecast_relay.adapters.decoded import Decoded
from posecast_relay.adapters.models import Absent, Models, Unavailable
from posecast_relay.adapters.pump import Pump
from posecast_relay.core.robot import PUBLIC
from posecast_relay.listing import robot_document, robots_document
from posecast_relay.state_json import StateReader

PACKED_PAGE = Path(__file__).parent / "page"  # the built page, where the wheel carries it
API = "/api/v1/robots"
FRESH_S = 1.0  # answers are this old at most
ANSWERS_MAX = 256
OPEN = {"access-control-allow-origin": "*"}  # public views: any page may read them
PREFLIGHT = OPEN | {
    "access-control-allow-methods": "GET, OPTIONS",
    "access-control-allow-headers": "authorization, if-none-match, last-event-id",
    "access-control-max-age": "86400",
}
# A model comes from a robot. Opened as a page of its own, nothing in it may run or load anything.
MODEL_HEADERS = OPEN | {
    "cache-control": "public, max-age=31536000, immutable",
    "content-security-policy": "default-src 'none'; sandbox",
    "x-content-type-options": "nosniff",
}


class Answers:
    """JSON answers, each made at most once a second however many ask; with an ETag."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._made: dict[str, tuple[float, bytes, str]] = {}

    def answer(self, request: Request, name: str, make: Callable[[], dict[str, Any]]) -> Response:
        """The answer called `name`, or 304 when the asker has it."""
        now = self._now()
        made = self._made.get(name)
        if made is None or now - made[0] >= FRESH_S:
            body = json.dumps(make(), separators=(",", ":"), ensure_ascii=False).encode()
            made = (now, body, f'"{hashlib.sha256(body).hexdigest()[:16]}"')
            if len(self._made) >= ANSWERS_MAX:
                self._made.clear()
            self._made[name] = made
        _, body, etag = made
        headers = OPEN | {"etag": etag, "cache-control": "public, max-age=1"}
        if etag in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        return Response(body, media_type="application/json", headers=headers)


class Page(StaticFiles):
    """The built page. Its index is asked for anew each time; files with a hash in their name never are."""

    def file_response(
        self, full_path: Any, stat_result: os.stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        """With the right cache header; packed where the build packed it and the browser can unpack."""
        packed = f"{full_path}.gz"
        unpacks = "gzip" in Headers(scope=scope).get("accept-encoding", "") and os.path.isfile(packed)
        served, stat = (packed, os.stat(packed)) if unpacks else (full_path, stat_result)
        response = super().file_response(served, stat, scope, status_code)
        response.headers["vary"] = "accept-encoding"
        if unpacks:
            response.headers["content-encoding"] = "gzip"
        hashed = "/assets/" in scope["path"]
        response.headers["cache-control"] = "public, max-age=31536000, immutable" if hashed else "no-cache"
        response.headers["x-content-type-options"] = "nosniff"
        return response


def make_app(pump: Pump, models: Models, decoded: Decoded, static: Path | None) -> FastAPI:
    """The relay's HTTP application. WebSocket upgrades never reach it."""
    # /docs would load its scripts from another origin, so only the description itself is served
    app = FastAPI(title="Posecast relay", version="1", docs_url=None, redoc_url=None)
    answers = Answers(pump.now)
    reader = StateReader(pump.now, decoded)

    @app.exception_handler(StarletteHTTPException)
    async def refused(_request: Request, error: StarletteHTTPException) -> JSONResponse:
        return JSONResponse({"error": error.detail}, error.status_code, dict(error.headers or {}) | OPEN)

    @app.get(API, summary="Robots on air")
    async def robots(request: Request) -> Response:
        return answers.answer(request, "", lambda: robots_document(pump.hub, pump.store, pump.now()))

    @app.get(API + "/{robot}", summary="One robot: liveness, viewers, schema, model")
    async def one_robot(request: Request, robot: str) -> Response:
        await pump.open(robot)
        of = pump.hub.robots.get(robot)
        if of is None or of.heard_at is None:
            raise HTTPException(404, f"no robot {robot!r} here")
        return answers.answer(request, robot, lambda: robot_document(of, pump.hub, pump.store, pump.now()))

    @app.get(API + "/{robot}/state", summary="The newest state with names and units")
    async def state(robot: str, view: str = PUBLIC) -> Response:
        await pump.open(robot)
        of = pump.hub.robots.get(robot)
        room = of.rooms.get(view) if of is not None and view == PUBLIC else None
        if of is None or room is None or room.stream.newest is None:
            raise HTTPException(404, f"no state of robot {robot!r} here")
        body = reader.read(of, room)
        return Response(body, media_type="application/json", headers=OPEN | {"cache-control": "no-cache"})

    @app.get(API + "/{robot}/live.sse", summary="The stream as server-sent events: hz, view, format=json")
    async def events(robot: str) -> Response:  # served below ASGI; here are only those it can't serve
        raise HTTPException(400, f"events of {robot!r} on a connection that is still answering")

    @app.options("/api/{_rest:path}", include_in_schema=False)
    async def preflight(_rest: str) -> Response:
        return Response(status_code=204, headers=PREFLIGHT)

    @app.get(API + "/{robot}/model/{digest}/{path:path}", summary="A model's manifest.json and files")
    async def model(robot: str, digest: str, path: str) -> Response:
        try:
            if path == "manifest.json":
                data, kind = await models.manifest(robot, digest), "application/json"
            else:
                data, kind = await models.file(robot, digest, path)
        except Absent as e:
            raise HTTPException(404, str(e)) from None
        except Unavailable as e:
            raise HTTPException(503, str(e), {"retry-after": "5"}) from None
        return Response(data, media_type=kind, headers=MODEL_HEADERS)

    @app.get("/livez", summary="The process answers")
    async def livez() -> PlainTextResponse:
        return PlainTextResponse("ok\n")

    @app.get("/readyz", summary="Whether viewers are accepted; `degraded` when the store is not there")
    async def readyz() -> JSONResponse:
        trouble = pump.store.trouble()
        if pump.draining:
            return JSONResponse({"status": "draining"}, 503)
        return JSONResponse({"status": "degraded", "why": trouble} if trouble else {"status": "ready"})

    @app.get("/api/{_rest:path}", include_in_schema=False)
    async def no_such_route(_rest: str) -> Response:
        raise HTTPException(404, "no such route")

    page = static or (PACKED_PAGE if (PACKED_PAGE / "index.html").is_file() else None)
    if page is not None:
        app.mount("/", Page(directory=page, html=True))
    else:

        @app.get("/", include_in_schema=False)
        async def no_page() -> PlainTextResponse:
            return PlainTextResponse("The relay serves; no page is built. See /openapi.json\n", 404)

    return app
