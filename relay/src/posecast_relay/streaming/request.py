"""Parses a viewer's request for a stream, for WebSocket and server-sent events."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable
from dataclasses import dataclass
from http import HTTPStatus
from urllib.parse import parse_qs

from posecast_wire import check_name, clamp_hz

from posecast_relay.core.policy.admission import Applicant

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
        *(found[1], asked.get("view", [None])[0], clamp_hz(hz), form == "json"),
        auth=asked.get("auth") == ["1"],
    )
