"""Decides who is let in: one pure function for WebSockets, event streams and every HTTP route.

Facts that need I/O (an address, a token) are passed in as values once they are known. A caller may be judged
again when more is known. A refusal holds everything that each kind of connection needs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from http import HTTPStatus

from posecast_wire import Close

from posecast_relay.core.policy.lane import find_lane
from posecast_relay.core.policy.policy import Grant, Policy, Principal

HIDDEN = "no such robot, or you may not see it"
GOING = "the relay is being replaced"
FULL_RETRY_S = 30.0
DRAIN_RETRY_S = 0.5  # viewers leave a few at a time, so their return is already spread


@dataclass(frozen=True)
class Refusal:
    """Why a viewer or caller is refused: a close code, an HTTP status, a text, and when to retry.

    `at_door`: refused before a stream exists, so that a WebSocket also gets the HTTP status. `retry_s` None:
    the close code alone says whether to retry. `lane`: where to read on meanwhile.
    """

    close: Close
    status: HTTPStatus
    reason: str
    retry_s: float | None = None
    at_door: bool = False
    lane: str | None = None


# Refusals of a page's origin or of an address come before a WebSocket begins.
FOREIGN = Refusal(
    Close.FORBIDDEN, HTTPStatus.FORBIDDEN, "pages of this origin may not use it", None, at_door=True
)
CROWDED = Refusal(
    *(Close.FULL, HTTPStatus.SERVICE_UNAVAILABLE, "too many streams from this address", FULL_RETRY_S),
    at_door=True,
)
# Refusals because of a token or the policy, by close code.
REFUSALS = {
    refusal.close: refusal
    for refusal in (
        Refusal(Close.TOKEN, HTTPStatus.UNAUTHORIZED, "the link or sign-in is invalid or has expired"),
        Refusal(Close.ABSENT, HTTPStatus.NOT_FOUND, HIDDEN),
        Refusal(Close.FORBIDDEN, HTTPStatus.FORBIDDEN, "you may not see this view"),
        Refusal(
            Close.FULL,
            HTTPStatus.SERVICE_UNAVAILABLE,
            "your sign-in can't be checked right now",
            FULL_RETRY_S,
        ),
        Refusal(
            Close.INTERNAL_ERROR,
            HTTPStatus.INTERNAL_SERVER_ERROR,
            "internal error of the relay at this connection",
        ),
    )
}
# Refusals because of the viewers that are already here.
DRAINING = Refusal(Close.DRAIN, HTTPStatus.SERVICE_UNAVAILABLE, GOING, DRAIN_RETRY_S)
FULL = Refusal(
    *(Close.FULL, HTTPStatus.SERVICE_UNAVAILABLE, "the relay has no room for more viewers", FULL_RETRY_S)
)
ROBOT_FULL = Refusal(
    *(Close.FULL, HTTPStatus.SERVICE_UNAVAILABLE, "this robot has no room for more viewers", FULL_RETRY_S)
)


@dataclass(frozen=True)
class Occupancy:
    """The viewers that are already here when another one wants to join. The hub counts them."""

    viewers: int
    viewers_max: int
    of_audience: int = 0  # under the same audience's rule for the same robot
    is_draining: bool = False


@dataclass(frozen=True)
class Applicant:
    """What is known so far of a caller and its request."""

    robot: str | None = None  # None: the request is about no single robot, for example the list
    view: str | None = None  # None: any view they may see
    shows_token: bool = False  # or announces one
    is_foreign: bool = False  # a page whose origin may only show public data
    is_crowded: bool = False  # their address has reached its limit of streams
    bad_name: str | None = None  # why this name of a robot or view is invalid
    who: Principal | Close | None = None  # None: not known yet; a close code: why it can't be known


def admit(applicant: Applicant, policy: Policy, has_past: bool = False) -> Grant | Refusal | None:
    """Return what an applicant may see of a robot, or why they are refused.

    None: there is no reason to refuse, but the robot or the applicant is not known yet. `has_past`: whether
    this process serves the past, so that a lane can exist.

    The checks run in order of cost: first the request itself, then who is asking, then what they may see.
    `find_no_room` judges whether there is room when they join.
    """
    if applicant.shows_token and applicant.is_foreign:
        return FOREIGN
    if applicant.is_crowded:
        lane = _find_lane(applicant, policy) if has_past else None
        # a browser can't see why a handshake failed, so let it in to send it the lane
        return CROWDED if lane is None else replace(CROWDED, at_door=False, lane=lane)
    if applicant.bad_name is not None:
        return Refusal(Close.ABSENT, HTTPStatus.NOT_FOUND, applicant.bad_name)
    found: Grant | Close | None = None
    if isinstance(applicant.who, Close):
        found = applicant.who
    elif applicant.who is not None and applicant.robot is not None:
        found = policy.judge(applicant.who, applicant.robot, applicant.view)
    if has_past and isinstance(found, Grant):
        found = replace(found, lane=_find_lane(applicant, policy))
    return REFUSALS[found] if isinstance(found, Close) else found


def _find_lane(applicant: Applicant, policy: Policy) -> str | None:
    """Return the lane of the public part of what they ask for."""
    if applicant.robot is None or applicant.bad_name is not None:
        return None
    return find_lane(policy, applicant.robot, applicant.view)


def find_no_room(grant: Grant | None, occupancy: Occupancy) -> Refusal | None:
    """Return why a viewer who may watch can't join now; None if there is room. `grant` None: none was
    requested.

    This is the last step of admission. It is a separate function because only a hub counts viewers, and only
    at that moment. A viewer that is refused only by the limit of the whole relay is sent the lane, if there
    is one.
    """
    if occupancy.is_draining:
        return DRAINING
    is_capped = grant is not None and grant.viewers is not None and occupancy.of_audience >= grant.viewers
    if occupancy.viewers >= occupancy.viewers_max:
        lane = None if grant is None or is_capped else grant.lane
        return FULL if lane is None else replace(FULL, lane=lane)
    return ROBOT_FULL if is_capped else None
