"""HTTP: what is on air, the state as plain JSON, models, health, and the page."""

from __future__ import annotations

import hashlib
import html
import json
import os
import re
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import FastAPI, HTTPException, Request, Response
from fastapi.responses import JSONResponse, PlainTextResponse
from fastapi.staticfiles import StaticFiles
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException as StarletteHTTPException
from starlette.types import Scope

from posecast_relay.adapters.access import HIDDEN, Access
from posecast_relay.adapters.decoded import Decoded
from posecast_relay.adapters.models import Absent, ModelFile, Models, Unavailable
from posecast_relay.adapters.packed import Packed
from posecast_relay.adapters.pump import Pump
from posecast_relay.asker import OPEN, asker, granted, shown_to
from posecast_relay.core.policy import ANYONE
from posecast_relay.listing import robot_document, robots_document
from posecast_relay.state_json import StateReader

PACKED_PAGE = Path(__file__).parent / "page"  # the built page, where the wheel carries it
API = "/api/v1/robots"
FRESH_S = 1.0  # answers are this old at most
ANSWERS_MAX = 256
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
FRAMES = "frame-ancestors 'none'"  # only a header may say so, not the page
# the page's entry for frames: /embed/ROBOT, or /embed/, where only the fragment names the robot
EMBED = re.compile(r"/embed/(?:index\.html)?(?P<robot>[a-z0-9][a-z0-9-]{0,62})?")
# of such an answer: the policy may change and the file not, so nothing of it may be kept
NOT_FRAMED = ("x-frame-options", "etag", "last-modified")
PAGE_HEADERS = {
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
}
POLICY = re.compile(r'(?i)<meta\s+http-equiv="content-security-policy"\s+content="([^"]*)"')
PACKED_BYTES_MAX = 32_000_000  # kept in memory, over all models
PACK_UP_TO_BYTES = 4_000_000  # a finest level; packing more would keep its first viewer waiting


class Answers:
    """JSON answers, each made at most once a second however many ask; with an ETag."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._made: dict[str, tuple[float, bytes, str]] = {}

    def answer(
        self, request: Request, name: str, make: Callable[[], dict[str, Any]], more: dict[str, str]
    ) -> Response:
        """The answer called `name`, or 304 when the asker has it. `more`: headers."""
        now = self._now()
        made = self._made.get(name)
        if made is None or now - made[0] >= FRESH_S:
            body = json.dumps(make(), separators=(",", ":"), ensure_ascii=False).encode()
            made = (now, body, f'"{hashlib.sha256(body).hexdigest()[:16]}"')
            if len(self._made) >= ANSWERS_MAX:
                self._made.clear()
            self._made[name] = made
        _, body, etag = made
        headers = {"etag": etag, "cache-control": "public, max-age=1"} | more
        if etag in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        return Response(body, media_type="application/json", headers=headers)


def content_policy(page: Path) -> str | None:
    """What a page says it may load; None: nothing. As a header it binds the page's workers as well."""
    try:
        return _policy_in(page, page.stat().st_mtime_ns)
    except OSError:  # it is just being built anew
        return None


@lru_cache(maxsize=16)
def _policy_in(page: Path, _mtime_ns: int) -> str | None:
    found = POLICY.search(page.read_text(encoding="utf-8"))
    return None if found is None else " ".join(html.unescape(found[1]).split())


class Page(StaticFiles):
    """The built page. Its index is asked for anew each time; files with a hash in their name never are."""

    def __init__(self, folder: Path, frame_ancestors: Callable[[str], Sequence[str]]) -> None:
        """`frame_ancestors` of a robot, "" for any: see Policy."""
        super().__init__(directory=folder, html=True)
        self._index = folder / "index.html"
        self._frame_ancestors = frame_ancestors

    async def get_response(self, path: str, scope: Scope) -> Response:
        """A frame's page is the same file for every robot, with the robot's own header."""
        framed = EMBED.fullmatch(scope["path"])
        if framed is None:
            return await super().get_response(path, scope)
        kept = [(k, v) for k, v in scope["headers"] if k not in (b"if-none-match", b"if-modified-since")]
        response = await super().get_response("embed/index.html", {**scope, "headers": kept})
        if response.status_code == HTTPStatus.OK:
            frames = "frame-ancestors " + " ".join(self._frame_ancestors(framed["robot"] or ""))
            policy = response.headers.get("content-security-policy", FRAMES)
            response.headers["content-security-policy"] = policy.replace(FRAMES, frames)
            for name in NOT_FRAMED:
                del response.headers[name]
        return response

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
        page = Path(full_path) if str(full_path).endswith(".html") else self._index if hashed else None
        policy = None if page is None else content_policy(page)
        if policy is not None:
            response.headers["content-security-policy"] = policy if hashed else f"{policy}; {FRAMES}"
        if page is not None and not hashed:
            response.headers.update(PAGE_HEADERS)
        return response


async def model_answer(request: Request, found: ModelFile, packed: Packed) -> Response:
    """A model's file, for ever: packed where that helps and the asker can unpack; 304 if it has it."""
    headers = MODEL_HEADERS | {"etag": f'"{found.sha256}"', "vary": "accept-encoding"}
    if headers["etag"] in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    data, small = found.data, len(found.data) <= PACK_UP_TO_BYTES
    if small and not found.type.startswith("image/") and "gzip" in request.headers.get("accept-encoding", ""):
        gzipped = await packed.pack(found.sha256, found.data)
        if gzipped is not None:
            data = gzipped
            headers["content-encoding"] = "gzip"
            headers["etag"] = f'W/"{found.sha256}"'
    return Response(data, media_type=found.type, headers=headers)


def make_app(access: Access, models: Models, decoded: Decoded, static: Path | None) -> FastAPI:
    """The relay's HTTP application. WebSocket upgrades never reach it."""
    # FastAPI's own /docs loads its scripts from another origin; the built page brings them (spa/public/docs)
    app = FastAPI(title="Posecast relay", version="1", docs_url=None, redoc_url=None)

    @app.exception_handler(StarletteHTTPException)
    async def refused(_request: Request, error: StarletteHTTPException) -> JSONResponse:
        return JSONResponse({"error": error.detail}, error.status_code, dict(error.headers or {}) | OPEN)

    _add_robots(app, access, decoded)

    @app.get(API + "/{robot}/live.sse", summary="The stream as server-sent events: hz, view, format=json")
    async def events(robot: str) -> Response:  # served below ASGI; here are only those it can't serve
        raise HTTPException(400, f"events of {robot!r} on a connection that is still answering")

    @app.options("/api/{_rest:path}", include_in_schema=False)
    async def preflight(_rest: str) -> Response:
        return Response(status_code=204, headers=PREFLIGHT)

    _add_models(app, access, models)
    _add_health(app, access.live)

    @app.get("/api/{_rest:path}", include_in_schema=False)
    async def no_such_route(_rest: str) -> Response:
        raise HTTPException(404, "no such route")

    page = static or (PACKED_PAGE if (PACKED_PAGE / "index.html").is_file() else None)
    if page is not None:
        app.mount("/", Page(page, access.frame_ancestors))
    else:

        @app.get("/", include_in_schema=False)
        async def no_page() -> PlainTextResponse:
            return PlainTextResponse("The relay serves; no page is built. See /openapi.json\n", 404)

    return app


def _add_health(app: FastAPI, pump: Pump) -> None:
    @app.get("/livez", summary="The process answers")
    async def livez() -> PlainTextResponse:
        return PlainTextResponse("ok\n")

    @app.get("/readyz", summary="Whether viewers are accepted; `degraded` when the store is not there")
    async def readyz() -> JSONResponse:
        trouble = pump.store.trouble()
        if pump.draining:
            return JSONResponse({"status": "draining"}, 503)
        return JSONResponse({"status": "degraded", "why": trouble} if trouble else {"status": "ready"})


def _add_robots(app: FastAPI, access: Access, decoded: Decoded) -> None:
    pump = access.live
    answers = Answers(pump.now)
    reader = StateReader(pump.now, decoded)

    @app.get(API, summary="Robots on air")
    async def robots(request: Request) -> Response:
        who = await asker(access, request)
        made = partial(robots_document, access, who, pump.now())
        headers = shown_to(request, who is ANYONE)
        return answers.answer(request, f"{who.audience}/{who.robot}", made, headers)

    @app.get(API + "/{robot}", summary="One robot: liveness, viewers, schema, model")
    async def one_robot(request: Request, robot: str) -> Response:
        grant = await granted(access, request, robot)
        await pump.open(robot)
        found = access.shown(grant)
        if found is None:
            raise HTTPException(404, HIDDEN)
        made = partial(robot_document, access, grant, *found, pump.now())
        name = f"{robot}/{grant.view}/{grant.delay_s:g}"
        return answers.answer(request, name, made, shown_to(request, grant.open))

    @app.get(API + "/{robot}/state", summary="The newest state with names and units")
    async def state(request: Request, robot: str, view: str | None = None) -> Response:
        grant = await granted(access, request, robot, view)
        await pump.open(robot)
        of, room = access.shown(grant) or (None, None)
        if of is None or room is None or room.stream.newest is None:
            raise HTTPException(404, HIDDEN)
        body = reader.read(of, room, grant.hz)
        headers = {"cache-control": "no-cache"} | shown_to(request, grant.open)
        return Response(body, media_type="application/json", headers=headers)


def _add_models(app: FastAPI, access: Access, models: Models) -> None:
    packed = Packed(PACKED_BYTES_MAX)

    @app.get(API + "/{robot}/model/{digest}/{path:path}", summary="A model's manifest.json and files")
    async def model(request: Request, robot: str, digest: str, path: str) -> Response:
        grant = await granted(access, request, robot)
        try:
            if path == "manifest.json":
                found = ModelFile(await models.manifest(robot, digest), "application/json", digest)
            else:
                found = await models.file(robot, digest, path)
        except Absent as e:
            raise HTTPException(404, str(e)) from None
        except Unavailable as e:
            raise HTTPException(503, str(e), {"retry-after": "5"}) from None
        answer = await model_answer(request, found, packed)
        if not grant.open:
            del answer.headers["access-control-allow-origin"]
            answer.headers.update(shown_to(request, False))
        return answer
