"""The routes of the page `/admin`: its report, and share links that it makes and revokes."""

from __future__ import annotations

import hmac
import logging
import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from fastapi import FastAPI, HTTPException, Request, Response
from fastapi.responses import FileResponse, JSONResponse, RedirectResponse
from posecast_wire import check_name

from posecast_relay.auth.access import Access
from posecast_relay.auth.addresses import find_asker
from posecast_relay.auth.origins import may_show
from posecast_relay.blocking_calls import BlockingCalls
from posecast_relay.config.robots_changes import RobotsDocument
from posecast_relay.config.robots_file import read_text
from posecast_relay.config.robots_reader import AdminEntry, RobotsError
from posecast_relay.config.robots_storage import lock_folder, replace_text
from posecast_relay.config.settings import SettingsError
from posecast_relay.http.admin import documents
from posecast_relay.http.admin.report import AdminSources, make_report
from posecast_relay.http.auth import is_on_this_machine
from posecast_relay.streaming.request import join_all, read_bearer

log = logging.getLogger("posecast_relay")

API = "/api/v1/admin"
PAGE = Path(__file__).parent / "page"
FILES = {"": "index.html", "admin.js": "admin.js", "admin.css": "admin.css"}
PRIVATE = {"cache-control": "no-store"}
PAGE_HEADERS = PRIVATE | {
    # allows only its own two files and routes; no forms, no embedding; its icon is an empty data: URL
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "x-content-type-options": "nosniff",
    "permissions-policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
}
ERRORS: dict[int | str, dict[str, Any]] = {
    401: {"description": "Missing or wrong credential for this page"},
    403: {"description": "The client's address or the page's origin is not allowed"},
    404: {"description": "The robots file has no credential for this page"},
}
CHANGE_ERRORS = ERRORS | {
    400: {"description": "Invalid robot name or number of days"},
    409: {"description": "The robots file does not allow it; `error` tells why"},
    503: {"description": "The robots file can't be written; `error` tells why"},
}
DAYS = re.compile(r"[1-9][0-9]{0,3}", re.ASCII)


def add_admin_routes(
    app: FastAPI, access: Access, sources: AdminSources, find_trouble: Callable[[], str | None]
) -> None:
    """Add the page and its routes. Without `[admin]` in the robots file, all of them answer 404.

    `find_trouble` returns the relay's present problem, in one line; None if it has none.
    """
    calls = BlockingCalls(1, "robots file")  # it waits for seconds while a command changes the file

    @app.get("/admin", include_in_schema=False)
    async def without_slash(request: Request) -> Response:
        _require_place(access, sources, request)
        return RedirectResponse("admin/", headers=PRIVATE)

    @app.get("/admin/{name:path}", include_in_schema=False)
    async def page(request: Request, name: str) -> Response:
        _require_place(access, sources, request)
        if name not in FILES:
            raise HTTPException(404, "no such file")
        return FileResponse(PAGE / FILES[name], headers=PAGE_HEADERS)

    @app.get(
        API,
        summary="Data of the page /admin; needs its credential",
        responses=ERRORS | _tells(documents.AdminReport),
    )
    async def report(request: Request) -> JSONResponse:
        _require_admin(access, sources, request)
        return JSONResponse(make_report(access, sources, find_trouble()), headers=PRIVATE)

    @app.post(
        API + "/robots/{robot}/links",
        summary="Make a share link, valid for days= (7 by default)",
        responses=CHANGE_ERRORS | _tells(documents.MadeShareLink),
    )
    async def make_link(request: Request, robot: str, days: str = "7") -> JSONResponse:
        _require_admin(access, sources, request)
        if not DAYS.fullmatch(days):
            raise HTTPException(400, "days: use a whole number from 1 to 9999")
        until = datetime.now(UTC) + timedelta(days=int(days))
        token = await _change(calls, sources.path, robot, lambda doc: doc.make_share_link(robot, until))
        log.warning("admin: a share link of %s was made, valid for %s days", robot, days)
        page = "" if sources.public_url is None else f"{sources.public_url}/"
        answer = {"link": f"{page}#/r/{robot}?t={token}", "until_s": round(until.timestamp())}
        return JSONResponse(answer, headers=PRIVATE)

    @app.delete(
        API + "/robots/{robot}/links",
        summary="Revoke all share links of this robot",
        responses=CHANGE_ERRORS | _tells(documents.Nothing),
    )
    async def revoke_links(request: Request, robot: str) -> JSONResponse:
        _require_admin(access, sources, request)

        def revoke(doc: RobotsDocument) -> str:
            doc.revoke_share_links(robot)
            return ""

        await _change(calls, sources.path, robot, revoke)
        log.warning("admin: all share links of %s were revoked", robot)
        return JSONResponse({}, headers=PRIVATE)


def _tells(model: type) -> dict[int | str, dict[str, Any]]:
    """Describe a response schema, for OpenAPI."""
    return {200: {"model": model, "description": "JSON"}}


def _require_place(access: Access, sources: AdminSources, request: Request) -> AdminEntry:
    """Return who can use the page. Raises HTTPException 404 if nobody can, 403 if the client's address or
    the page's origin is not allowed.
    """
    admin = sources.get_robots().admin
    if admin is None:
        raise HTTPException(404, "no such route")
    headers = request.headers
    if not may_show(headers.get("origin"), headers.get("host"), ()):
        raise HTTPException(403, "requests from pages of other origins are not allowed", PRIVATE)
    if not is_on_this_machine(access, request):
        peer = "" if request.client is None else request.client.host
        # a proxy may have added a second header after one that the client sent
        forwarded = join_all(headers.getlist("x-forwarded-for"))
        asker = find_asker(peer, forwarded, access.addresses.trusted)
        if asker is None or not any(asker in network for network in admin.networks):
            raise HTTPException(403, "only from the relay's machine or the networks of [admin]", PRIVATE)
    return admin


def _require_admin(access: Access, sources: AdminSources, request: Request) -> None:
    """Raises HTTPException 401 without the credential; see also _require_place."""
    admin = _require_place(access, sources, request)
    token = read_bearer(request.headers.get("authorization")) or ""
    if not hmac.compare_digest(token.encode(), admin.secret.encode()):
        raise HTTPException(401, "wrong or missing credential", PRIVATE | {"www-authenticate": "Bearer"})


async def _change(
    calls: BlockingCalls, path: Path, robot: str, change: Callable[[RobotsDocument], str]
) -> str:
    """Change the robots file and return the result of `change`. Raises HTTPException, with one line."""

    def write() -> str:
        with lock_folder(path):
            before = read_text(path)
            doc = RobotsDocument(before, path.name)
            made = change(doc)
            text = doc.make_text()
            if text != before:
                replace_text(path, text)
            return made

    try:
        check_name("robot", robot)
        return await calls.run(write)
    except (SettingsError, RobotsError) as e:
        raise HTTPException(409, str(e), PRIVATE) from None
    except ValueError as e:
        raise HTTPException(400, str(e), PRIVATE) from None
    except OSError as e:
        why = (e.strerror or str(e)).lower()
        raise HTTPException(503, f"the robots file can't be written: {why}", PRIVATE) from None
