"""Identifies the sender of an HTTP request, what they may see, and which pages may read the answer."""

from __future__ import annotations

import re
from dataclasses import replace

from fastapi import HTTPException, Request
from posecast_wire import Close

from posecast_relay.auth.access import Access
from posecast_relay.auth.addresses import is_loopback
from posecast_relay.core.policy.admission import Applicant, Refusal
from posecast_relay.core.policy.policy import ANYONE, Grant, Principal
from posecast_relay.streaming.request import BadRequest, read_bearer, refuse_tokens

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
    decision = access.judge(await _identify_applicant(access, request, robot, view))
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
