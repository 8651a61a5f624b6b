"""Who asks over HTTP, what of a robot they may see, and which pages may read the answer."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import HTTPException, Request
from posecast_wire import Close

from posecast_relay.auth.access import FOREIGN, REASONS, STATUSES, Access
from posecast_relay.core.policy.policy import ANYONE, Grant, Principal
from posecast_relay.streaming.request import BadRequest, bearer, refuse_tokens

OPEN = {"access-control-allow-origin": "*"}  # public views: any page may read them


async def asker(access: Access, request: Request) -> Principal:
    """By the `Authorization` header; anyone without one. HTTPException 400, 401, 403, 503."""
    try:
        refuse_tokens(request.query_params)
    except BadRequest as e:
        raise HTTPException(e.status, str(e)) from None
    token = bearer(request.headers.get("authorization"))
    if token is None or access.tokens is None:
        return ANYONE
    if not access.may_show(request.headers.get("origin"), request.headers.get("host")):
        raise HTTPException(HTTPStatus.FORBIDDEN, FOREIGN)
    who = await access.who(token)
    if isinstance(who, Close):
        more = {"www-authenticate": "Bearer"} if who is Close.TOKEN else {"retry-after": "30"}
        raise HTTPException(STATUSES[who], REASONS[who], more)
    return who


def shown_to(request: Request, everybody: bool) -> dict[str, str]:
    """Headers: any page may read what is for everybody; else the one that was let in, and nothing is kept."""
    if everybody:
        return OPEN
    origin = request.headers.get("origin")
    pages = {"access-control-allow-origin": origin, "vary": "origin"} if origin else {}
    return {"cache-control": "no-store"} | pages


async def granted(access: Access, request: Request, robot: str, view: str | None = None) -> Grant:
    """HTTPException: the same for a robot that is not here and one that is not for the asker."""
    grant = access.judge(await asker(access, request), robot, view)
    if isinstance(grant, Close):
        raise HTTPException(STATUSES[grant], REASONS[grant])
    return grant
