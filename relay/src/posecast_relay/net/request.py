"""Reads a request: which stream a viewer wants, who sent it, what they may see, which pages may read the
answer, and how it may be compressed.
"""

from __future__ import annotations

import random
import re
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, replace
from http import HTTPStatus
from urllib.parse import parse_qs

from fastapi import HTTPException, Request
from posecast_wire import Close, check_name, clamp_hz
from starlette.datastructures import Headers

from posecast_relay.auth.access import Access
from posecast_relay.auth.addresses import is_loopback
from posecast_relay.core.policy import ANYONE, Applicant, Grant, Principal, Refusal
from posecast_relay.core.viewer import Outlet, Viewer
from posecast_relay.runtime.dispatcher import Dispatcher

STREAM_PATH = re.compile(r"/api/v1/robots/([^/]{1,200})/live(\.sse)?")
DEFAULT_HZ = "30"
NUMBER = re.compile(r"[0-9.eE+-]{1,32}")  # `float` alone would accept more, such as "inf" or "1_0"


class BadRequest(ValueError):
    """A request that gets an HTTP status instead of a stream."""

    def __init__(self, reason: str, status: HTTPStatus = HTTPStatus.BAD_REQUEST) -> None:
        super().__init__(reason)
        self.status = status


class NoSuchStream(ValueError):
    """The robot or view has no valid name."""


@dataclass(frozen=True)
class StreamRequest:
    """A stream as a viewer requested it. Its names are not checked yet."""

    robot: str
    view: str | None  # None: the view that the viewer may see
    hz: float
    decoded: bool  # frames as JSON instead of binary
    auth: bool = False  # a token comes as the first message

    def check(self) -> None:
        """Raise NoSuchStream if the robot or view has no valid name."""
        try:
            check_name("robot", self.robot)
            if self.view is not None:
                check_name("view", self.view)
        except ValueError as e:
            raise NoSuchStream(str(e)) from None

    def make_applicant(self, shows_token: bool, is_foreign: bool) -> Applicant:
        """Return the applicant, with the identity that the request itself shows."""
        bad_name = None
        try:
            self.check()
        except NoSuchStream as e:
            bad_name = str(e)
        return Applicant(self.robot, self.view, shows_token, is_foreign, bad_name=bad_name)


def make_viewer(
    outlet: Outlet, asked: StreamRequest, grant: Grant, dispatcher: Dispatcher, *, speaks: bool = True
) -> Viewer:
    """Make the viewer of a granted stream. `speaks`: it can send messages."""
    limits, now = dispatcher.hub.limits, dispatcher.now()
    return Viewer(
        outlet,
        robot=asked.robot,
        view=grant.view,
        hz=asked.hz,
        limits=limits,
        now=now,
        lives_s=limits.max_age_s * random.uniform(0.9, 1.1),
        decoded=asked.decoded,
        speaks=speaks,
        grant=grant,
        asked_view=asked.view,
        expires_at=dispatcher.compute_expiry(grant.who.until_s),
    )


def join_all(values: Iterable[str]) -> str | None:
    """Join the values of a repeated header to one list, as a proxy may have added a line.

    None without any.
    """
    return ", ".join(values) or None


def read_bearer(header: str | None) -> str | None:
    """Return the bearer token of an `Authorization` header; None without one."""
    kind, _, token = (header or "").partition(" ")
    return token.strip() or None if kind.lower() == "bearer" else None


def refuse_tokens(names: Container[str]) -> None:
    """Raise BadRequest when one of these parameters is a token's, since addresses are logged on the way."""
    if "token" in names or "access_token" in names:
        raise BadRequest("a token never stands in an address: send it as Authorization or first message")


def read_target(target: str, suffix: str = "") -> StreamRequest:
    """Parse the target `/api/v1/robots/ROBOT/live?…`, or `…/live.sse?…` with that suffix.

    Raises BadRequest, which says what is wrong.
    """
    path, _, query = target.partition("?")
    found = STREAM_PATH.fullmatch(path)
    if found is None or (found[2] or "") != suffix:
        raise BadRequest(f"no such stream: use /api/v1/robots/ROBOT/live{suffix}", HTTPStatus.NOT_FOUND)
    try:
        asked = parse_qs(query, keep_blank_values=True, max_num_fields=16)
    except ValueError:
        raise BadRequest("at most 16 parameters") from None
    wish = asked.get("hz", [DEFAULT_HZ])[0]
    try:
        hz = float(wish) if NUMBER.fullmatch(wish) else -1.0
    except ValueError:
        hz = -1.0
    if not 0 <= hz <= 1000:
        raise BadRequest("hz must be a number from 0 to 1000")
    form = asked.get("format", ["binary"])[0]
    if form not in ("binary", "json"):
        raise BadRequest("format must be binary or json")
    refuse_tokens(asked)
    return StreamRequest(
        robot=found[1],
        view=asked.get("view", [None])[0],
        hz=clamp_hz(hz),
        decoded=form == "json",
        auth=asked.get("auth") == ["1"],
    )


OPEN = {"access-control-allow-origin": "*"}  # public views: any page may read them
# further headers that show that a request came through a proxy
FORWARDED = frozenset(
    ("forwarded", "via", "x-real-ip", "x-client-ip", "true-client-ip", "cf-connecting-ip", "fastly-client-ip")
)
OWN_HOST = re.compile(r"(localhost|127(\.\d{1,3}){3}|\[::1\])(:\d{1,5})?", re.IGNORECASE)


async def identify_asker(access: Access, request: Request) -> Principal:
    """Return who sent the request, from its `Authorization` header; `anyone` without one.

    Raises HTTPException 400, 401, 403 or 503.
    """
    applicant = await _identify_applicant(access, request, None, None)
    assert isinstance(applicant.who, Principal)  # else refused
    return applicant.who


async def require_grant(access: Access, request: Request, robot: str, view: str | None = None) -> Grant:
    """Return what the sender may see of a robot.

    Raises HTTPException. The error is the same for a robot that does not exist and for a hidden one.
    """
    if view == "":
        raise HTTPException(400, "view: use a view's name, such as public, or leave view= out")
    decision = access.admit(await _identify_applicant(access, request, robot, view))
    if isinstance(decision, Refusal):
        raise _make_error(decision)
    return decision


async def _identify_applicant(
    access: Access, request: Request, robot: str | None, view: str | None
) -> Applicant:
    """Return the applicant with the sender's identity. Raises HTTPException if that identity is refused."""
    try:
        refuse_tokens(request.query_params)
    except BadRequest as e:
        raise HTTPException(e.status, str(e), {"cache-control": "private, no-store"}) from None
    token = read_bearer(request.headers.get("authorization"))
    if token is None or access.tokens is None:
        return Applicant(robot, view, who=ANYONE)
    may_show = access.may_show(request.headers.get("origin"), request.headers.get("host"))
    applicant = Applicant(robot, view, shows_token=True, is_foreign=not may_show)
    refusal = access.find_refusal(applicant)
    if refusal is None:
        applicant = replace(applicant, who=await access.identify(token))
        refusal = access.find_refusal(replace(applicant, robot=None))
    if refusal is not None:
        raise _make_error(refusal)
    return applicant


def _make_error(refusal: Refusal) -> HTTPException:
    headers = {} if refusal.retry_s is None else {"retry-after": f"{refusal.retry_s:.0f}"}
    if refusal.close is Close.TOKEN:
        headers["www-authenticate"] = "Bearer"
    return HTTPException(refusal.status, refusal.reason, headers)


def is_on_this_machine(access: Access, request: Request) -> bool:
    """Whether a request comes from the relay's machine, not from a proxy or another origin's page."""
    headers = request.headers
    origin, host = headers.get("origin"), headers.get("host")
    # DNS rebinding: another site's name may resolve to this machine, so the Host header is checked, too
    return (
        request.client is not None
        and is_loopback(request.client.host)
        and not any(name in FORWARDED or name.startswith("x-forwarded") for name in headers)
        and OWN_HOST.fullmatch(host or "") is not None
        # nginx's proxy_pass speaks HTTP/1.0 by default and sends 127.0.0.1 as Host; browsers and curl don't
        and request.scope["http_version"] != "1.0"
        and access.may_show(origin, host)
    )


def make_sharing_headers(request: Request, everybody: bool) -> dict[str, str]:
    """Make the headers that decide which pages may read an answer.

    If the answer is public, any page may. Otherwise only the page that asked may, and caches may not keep it.
    """
    if everybody:
        return OPEN
    origin = request.headers.get("origin")
    pages = {"access-control-allow-origin": origin, "vary": "origin"} if origin else {}
    return {"cache-control": "no-store"} | pages


IDENTITY = "identity"  # not compressed
WEIGHT = re.compile(r"(?:0(?:\.\d{0,3})?|1(?:\.0{0,3})?)")


def choose_encoding(headers: Headers, offered: Sequence[str]) -> str | None:
    """Return the client's choice of the encodings that the server has; None: send it uncompressed.

    Of encodings that the client likes equally, the first one counts. A client that refuses everything else,
    even what is uncompressed, gets it uncompressed all the same, as the RFC allows.
    """
    weights = _read_weights(", ".join(headers.getlist("accept-encoding")))
    best, best_weight = None, weights.get(IDENTITY, 0.0)
    for encoding in offered:
        weight = weights.get(encoding, weights.get("*", 0.0))
        if weight > best_weight or (weight == best_weight > 0.0 and best is None):
            best, best_weight = encoding, weight
    return best


def _read_weights(header: str) -> dict[str, float]:
    """Return the weight of each encoding in a header, in lower case. A malformed weight is no consent: 0."""
    weights: dict[str, float] = {}
    for part in header.lower().split(","):
        name, *parameters = (text.strip() for text in part.split(";"))
        weight = 1.0
        for parameter in parameters:
            key, _, value = (text.strip() for text in parameter.partition("="))
            if key == "q":
                weight = float(value) if WEIGHT.fullmatch(value) else 0.0
        if name:
            weights[name] = weight
    return weights
