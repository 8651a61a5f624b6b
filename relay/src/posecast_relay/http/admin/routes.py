"""The routes of the page `/admin`: what it shows, and share links, which it makes and revokes."""

from __future__ import annotations

import asyncio
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
    # nothing but its own two files and its own routes; no form leaves it, and nobody frames it; its icon is
    # an empty one that stands in the page
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "x-content-type-options": "nosniff",
    "permissions-policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
}
ERRORS: dict[int | str, dict[str, Any]] = {
    401: {"description": "Not the credential of this page"},
    403: {"description": "From another machine than may ask, or for a page of another origin"},
    404: {"description": "The file of robots has no credential for this page"},
}
CHANGE_ERRORS = ERRORS | {
    400: {"description": "There can be no such robot, or no such number of days"},
    409: {"description": "The file of robots does not allow it, and why"},
    503: {"description": "The file of robots can't be written, and why"},
}
DAYS = re.compile(r"[1-9][0-9]{0,3}", re.ASCII)


def add_admin_routes(
    app: FastAPI, access: Access, sources: AdminSources, find_trouble: Callable[[], str | None]
) -> None:
    """Add the page and its routes. Without `[admin]` in the file of robots all of them are 404.

    `find_trouble` returns what is wrong with the relay, in a line; None: nothing.
    """

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
        summary="What the page /admin shows; takes its credential",
        responses=ERRORS | _tells(documents.AdminReport),
    )
    async def report(request: Request) -> JSONResponse:
        _require_admin(access, sources, request)
        return JSONResponse(make_report(access, sources, find_trouble()), headers=PRIVATE)

    @app.post(
        API + "/robots/{robot}/links",
        summary="A new share link, good for days=; 7 without",
        responses=CHANGE_ERRORS | _tells(documents.MadeShareLink),
    )
    async def make_link(request: Request, robot: str, days: str = "7") -> JSONResponse:
        _require_admin(access, sources, request)
        if not DAYS.fullmatch(days):
            raise HTTPException(400, "days: want a whole number from 1 to 9999")
        until = datetime.now(UTC) + timedelta(days=int(days))
        token = await _change(sources.path, robot, lambda doc: doc.make_share_link(robot, until))
        log.warning("admin: a share link of %s was made, good for %s days", robot, days)
        page = "" if sources.public_url is None else f"{sources.public_url}/"
        answer = {"link": f"{page}#/r/{robot}?t={token}", "until_s": round(until.timestamp())}
        return JSONResponse(answer, headers=PRIVATE)

    @app.delete(
        API + "/robots/{robot}/links",
        summary="No share link of this robot is good from now on",
        responses=CHANGE_ERRORS | _tells(documents.Nothing),
    )
    async def revoke_links(request: Request, robot: str) -> JSONResponse:
        _require_admin(access, sources, request)

        def revoke(doc: RobotsDocument) -> str:
            doc.revoke_share_links(robot)
            return ""

        await _change(sources.path, robot, revoke)
        log.warning("admin: all share links of %s were revoked", robot)
        return JSONResponse({}, headers=PRIVATE)


def _tells(model: type) -> dict[int | str, dict[str, Any]]:
    """What an answer holds, for the description of the API."""
    return {200: {"model": model, "description": "JSON"}}


def _require_place(access: Access, sources: AdminSources, request: Request) -> AdminEntry:
    """Return who may use the page. Raises HTTPException 404 where nobody may, 403 for whoever asks from
    elsewhere than they may, or for a page of another origin.
    """
    admin = sources.get_robots().admin
    if admin is None:
        raise HTTPException(404, "no such route")
    headers = request.headers
    if not may_show(headers.get("origin"), headers.get("host"), ()):
        raise HTTPException(403, "a page of another origin", PRIVATE)
    if not is_on_this_machine(access, request):
        peer = "" if request.client is None else request.client.host
        # a proxy may have added a header of its own behind one that the asker wrote
        forwarded = join_all(headers.getlist("x-forwarded-for"))
        asker = find_asker(peer, forwarded, access.addresses.trusted)
        if asker is None or not any(asker in network for network in admin.networks):
            raise HTTPException(403, "only on the relay's own machine, or from networks of [admin]", PRIVATE)
    return admin


def _require_admin(access: Access, sources: AdminSources, request: Request) -> None:
    """Raises HTTPException, 401 without the credential; see _require_place."""
    admin = _require_place(access, sources, request)
    token = read_bearer(request.headers.get("authorization")) or ""
    if not hmac.compare_digest(token.encode(), admin.secret.encode()):
        raise HTTPException(401, "not the credential of this page", PRIVATE | {"www-authenticate": "Bearer"})


async def _change(path: Path, robot: str, change: Callable[[RobotsDocument], str]) -> str:
    """Change the file of robots, and return what `change` made. Raises HTTPException, with one line."""

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
        return await asyncio.to_thread(write)
    except (SettingsError, RobotsError) as e:
        raise HTTPException(409, str(e), PRIVATE) from None
    except ValueError as e:
        raise HTTPException(400, str(e), PRIVATE) from None
    except OSError as e:
        why = (e.strerror or str(e)).lower()
        raise HTTPException(503, f"the file of robots can't be written: {why}", PRIVATE) from None
