"""The routes of the page `/admin`: its report, and share links that it makes and revokes."""

from __future__ import annotations

import hmac
import logging
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Literal

from fastapi import FastAPI, HTTPException, Request, Response
from fastapi.responses import FileResponse, JSONResponse, RedirectResponse
from posecast_wire import check_name
from pydantic import Field

from posecast_relay.auth.access import Access
from posecast_relay.auth.addresses import find_asker, may_show
from posecast_relay.config.robots_changes import RobotsDocument
from posecast_relay.config.robots_file import lock_folder, read_text, replace_text
from posecast_relay.config.robots_reader import AdminEntry, RobotEntry, Robots, RobotsError, describe_rule
from posecast_relay.config.settings import SettingsError
from posecast_relay.core.policy import Audience
from posecast_relay.core.robot import Robot
from posecast_relay.http.metrics import ArchiveStats
from posecast_relay.net.answer_cache import AnswerDocument, Described, describe_json
from posecast_relay.net.request import is_on_this_machine, join_all, read_bearer
from posecast_relay.past.memory import MemoryPast
from posecast_relay.runtime.tasks import BlockingCalls


class RelayFigures(AnswerDocument):
    """The relay's counters since its start. `trouble`: its present problem, in one line."""

    trouble: str | None
    viewers: int
    delivered_frames: int
    skipped_frames: int
    refused_publishers: int


class AdminRobot(AnswerDocument):
    """A robot in the robots file. `expires_s`: when its credential expires, in unix seconds. `audiences`:
    what each audience can see, in words. `may_link`: whether the file has a rule for share links.

    The last five members need a robot that publishes to this process. `conflict`: two agents publish it.
    `over_share`: the limit that it exceeds, "" for none. `lateness_ms`: how late its frames arrive.
    `sent_views`: the views that it sends. `unsent_views`: by audience, the view that the file shows but the
    robot does not send.
    """

    robot: str
    publishes_by: Literal["credential", "certificate"]
    expires_s: int | None
    audiences: dict[str, str]
    may_link: bool
    has_links: bool
    viewers: int
    status: Literal["online", "silent", "offline"]
    conflict: bool = False
    over_share: str = ""
    lateness_ms: int = 0
    sent_views: list[str] = Field(default=[])
    unsent_views: dict[str, str] = Field(default={})


class PastMemory(AnswerDocument):
    """Memory that the past uses, and its limit."""

    bytes: int
    bytes_max: int


class ArchiveUse(AnswerDocument):
    """The state of the archive. `free_bytes` and `disk_bytes` describe its disk, if it has one."""

    trouble: str | None
    stored_bytes: int
    waiting_bytes: int
    free_bytes: int | None
    disk_bytes: int | None


class AdminReport(AnswerDocument):
    """Everything that the page shows. `past` and `archive` are null if none is kept. `certificates`: when
    each expires, in unix seconds, by the flag that names its file."""

    relay: RelayFigures
    robots: list[AdminRobot]
    past: PastMemory | None
    archive: ArchiveUse | None
    certificates: dict[str, int]


class MadeShareLink(AnswerDocument):
    """A share link. `link`: all of it with --public-url, else only from # on. `until_s`: unix seconds."""

    link: str
    until_s: int


class Nothing(AnswerDocument):
    """An empty answer: the request was carried out."""


@dataclass(frozen=True)
class AdminSources:
    """Sources of what the page shows.

    `path`: the robots file. `get_robots` returns its version in force. `find_expiries` returns when
    certificates expire, in unix seconds, by flag. `count_refused` returns the number of refused publishers.
    `public_url`: where people open robots, without a slash at its end; None if it is not set.
    """

    path: Path
    get_robots: Callable[[], Robots]
    find_expiries: Callable[[], Mapping[str, float]]
    count_refused: Callable[[], int]
    past: MemoryPast | None
    archive: ArchiveStats | None
    public_url: str | None


def make_report(access: Access, sources: AdminSources, trouble: str | None) -> dict[str, Any]:
    """Return what the page shows now, without secrets. `trouble`: the relay's problem now, in one line."""
    hubs = [dispatcher.hub for dispatcher in access.dispatchers]
    rooms = [room for hub in hubs for robot in hub.robots.values() for room in robot.rooms.values()]
    robots = sources.get_robots().enrolled
    past = sources.past
    archive = None if sources.archive is None else sources.archive.measure()._asdict()
    # a gateway hears only robots that are watched there; it knows the others from the store
    listed = access.live.store.list_robots()
    statuses = {doc["robot"]: str(doc["status"]) for doc in listed or ()}
    return {
        "relay": {
            "trouble": trouble,
            "viewers": sum(len(hub.viewers) for hub in hubs),
            "delivered_frames": sum(hub.delivered for hub in hubs) + sum(room.delivered for room in rooms),
            "skipped_frames": sum(hub.skipped for hub in hubs) + sum(room.skipped for room in rooms),
            "refused_publishers": sources.count_refused(),
        },
        "robots": [
            _make_row(access, name, entry, statuses.get(name))
            | (_compare_views(access, name, entry) if listed is None else {})
            for name, entry in sorted(robots.items())
        ],
        "past": None if past is None else {"bytes": past.bytes, "bytes_max": past.bytes_max},
        "archive": archive and {name: archive[name] for name in ArchiveUse.model_fields},
        "certificates": {flag: round(at_s) for flag, at_s in sources.find_expiries().items()},
    }


def _make_row(access: Access, name: str, entry: RobotEntry, told: str | None) -> dict[str, Any]:
    live = access.live
    robot = live.hub.robots.get(name)
    shown = {audience.value: describe_rule(audience, rule) for audience, rule in entry.rules.items()}
    return {
        "robot": name,
        "publishes_by": "certificate" if entry.secret is None else "credential",
        "expires_s": None if entry.expires_s == float("inf") else round(entry.expires_s),
        "audiences": shown,
        "may_link": Audience.LINK in entry.rules,
        "has_links": entry.link_key is not None,
        "viewers": access.count_viewers(name),
        **(_describe_robot(robot, live.now()) if robot is not None else {"status": told or "offline"}),
    }


def _describe_robot(robot: Robot, now: float) -> dict[str, Any]:
    return {
        "status": robot.compute_status(next(iter(robot.rooms.values()), None), now),
        "conflict": robot.in_conflict,
        "over_share": robot.share.find_exceeded_limit(now),
        "lateness_ms": round(robot.runs.lateness_s * 1000),
    }


def _compare_views(access: Access, name: str, entry: RobotEntry) -> dict[str, Any]:
    """Return the views that a robot sends, and the views that its rules show but it does not send. Empty
    before its first frame. Only for a process to which robots publish: a gateway hears only watched views.
    """
    robot = access.live.hub.robots.get(name)
    rooms = {} if robot is None else robot.rooms  # includes views that viewers asked for but nobody sends
    sent = sorted(view for view, room in rooms.items() if room.stream.schema is not None)
    if not sent:
        return {}
    shown = {audience.value: rule.view for audience, rule in entry.rules.items() if not rule.blackout}
    return {
        "sent_views": sent,
        "unsent_views": {audience: view for audience, view in shown.items() if view not in sent},
    }


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
ERRORS: Described = {
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
        _require_allowed_address(access, sources, request)
        return RedirectResponse("admin/", headers=PRIVATE)

    @app.get("/admin/{name:path}", include_in_schema=False)
    async def page(request: Request, name: str) -> Response:
        _require_allowed_address(access, sources, request)
        if name not in FILES:
            raise HTTPException(404, "no such file")
        return FileResponse(PAGE / FILES[name], headers=PAGE_HEADERS)

    @app.get(
        API,
        summary="Data of the page /admin; needs its credential",
        responses=ERRORS | describe_json(AdminReport),
    )
    async def report(request: Request) -> JSONResponse:
        _require_admin(access, sources, request)
        return JSONResponse(make_report(access, sources, find_trouble()), headers=PRIVATE)

    @app.post(
        API + "/robots/{robot}/links",
        summary="Make a share link, valid for days= (7 by default)",
        responses=CHANGE_ERRORS | describe_json(MadeShareLink),
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
        responses=CHANGE_ERRORS | describe_json(Nothing),
    )
    async def revoke_links(request: Request, robot: str) -> JSONResponse:
        _require_admin(access, sources, request)

        def revoke(doc: RobotsDocument) -> str:
            doc.revoke_share_links(robot)
            return ""

        await _change(calls, sources.path, robot, revoke)
        log.warning("admin: all share links of %s were revoked", robot)
        return JSONResponse({}, headers=PRIVATE)


def _require_allowed_address(access: Access, sources: AdminSources, request: Request) -> AdminEntry:
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
            who = "" if asker is None else f", not from {asker}"
            where = "only from the relay's machine or the networks of [admin]"
            raise HTTPException(403, f"{where}{who}: see `robots admin --networks`", PRIVATE)
    return admin


def _require_admin(access: Access, sources: AdminSources, request: Request) -> None:
    """Raises HTTPException 401 without the credential; see also _require_allowed_address."""
    admin = _require_allowed_address(access, sources, request)
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
