"""Decides who is let in: one pure function, used by WebSockets, event streams and every HTTP route alike.

What it takes I/O to find out (an address, a token) comes in as values, and as it becomes known: whoever asks
may be judged again when more is known of them. A refusal says everything of itself, for every way in.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from http import HTTPStatus

from posecast_wire import Close

from posecast_relay.core.policy.lane import find_lane
from posecast_relay.core.policy.policy import Grant, Policy, Principal

HIDDEN = "no such robot here, or not for you"
GOING = "the relay is being replaced"
FULL_RETRY_S = 30.0
DRAIN_RETRY_S = 0.5  # they are moved away a few at a time, so need not be spread once more
PREVIEW_HZ = 1.0


@dataclass(frozen=True)
class Refusal:
    """Why somebody is not let in: as a close code and as an HTTP status, in words, and when to try again.

    `at_door`: before there is a stream, so a WebSocket is answered by the status as well. `retry_s` None: the
    close code alone says whether to try again. `lane`: where to read on meanwhile.
    """

    close: Close
    status: HTTPStatus
    reason: str
    retry_s: float | None = None
    at_door: bool = False
    lane: str | None = None


# What a page of another origin, or an address, may not: they end before a WebSocket begins.
FOREIGN = Refusal(Close.FORBIDDEN, HTTPStatus.FORBIDDEN, "not for pages of this origin", None, at_door=True)
CROWDED = Refusal(
    *(Close.FULL, HTTPStatus.SERVICE_UNAVAILABLE, "as many streams as this address may have", FULL_RETRY_S),
    at_door=True,
)
# What comes of a token or of the policy, by close code.
REFUSALS = {
    refusal.close: refusal
    for refusal in (
        Refusal(Close.TOKEN, HTTPStatus.UNAUTHORIZED, "the link or sign-in is wrong or has expired"),
        Refusal(Close.ABSENT, HTTPStatus.NOT_FOUND, HIDDEN),
        Refusal(Close.FORBIDDEN, HTTPStatus.FORBIDDEN, "this view is not for you"),
        Refusal(
            Close.FULL,
            HTTPStatus.SERVICE_UNAVAILABLE,
            "who you are can't be found out just now",
            FULL_RETRY_S,
        ),
        Refusal(
            Close.INTERNAL_ERROR,
            HTTPStatus.INTERNAL_SERVER_ERROR,
            "a fault of the relay's own at this connection",
        ),
    )
}
# What comes of who is here already.
DRAINING = Refusal(Close.DRAIN, HTTPStatus.SERVICE_UNAVAILABLE, GOING, DRAIN_RETRY_S)
FULL = Refusal(
    *(Close.FULL, HTTPStatus.SERVICE_UNAVAILABLE, "as many viewers as this relay takes", FULL_RETRY_S)
)
ROBOT_FULL = Refusal(
    *(Close.FULL, HTTPStatus.SERVICE_UNAVAILABLE, "as many viewers as this robot takes", FULL_RETRY_S)
)


@dataclass(frozen=True)
class Occupancy:
    """Who watches already, when somebody is about to join. A hub counts it."""

    viewers: int
    viewers_max: int
    of_audience: int = 0  # by the same audience's rule for the same robot
    previews: int = 0  # of these, who gives way to a viewer
    previews_of_audience: int = 0
    is_draining: bool = False


@dataclass(frozen=True)
class Applicant:
    """Who asks for what, as far as it is known by now."""

    robot: str | None = None  # None: for what concerns no robot alone, as the list
    view: str | None = None  # None: whichever they may see
    shows_token: bool = False  # or says that one will come
    is_foreign: bool = False  # a page of an origin that may not show what is not for everybody
    is_crowded: bool = False  # their address has as many streams as it may
    bad_name: str | None = None  # why there can be no such robot or view
    who: Principal | Close | None = None  # None: not found out yet; a close code: why it can't be
    is_preview: bool = False  # they want a picture that moves now and then, and give way to viewers


def admit(applicant: Applicant, policy: Policy, has_past: bool = False) -> Grant | Refusal | None:
    """Return what an applicant may see of a robot, or why they are refused.

    None: there is no reason to refuse, but the robot or the applicant is not known yet. `has_past`: whether
    this process answers for the past, so that there can be a lane.

    The order is that of cost: what stands in the request, then who asks, then what that one may see. Whether
    there is room is judged when they join, by `find_no_room`.
    """
    if applicant.shows_token and applicant.is_foreign:
        return FOREIGN
    if applicant.is_crowded:
        lane = _find_lane(applicant, policy) if has_past else None
        # a browser does not see why it is turned away at the door: they are let in to be told the lane
        return CROWDED if lane is None else replace(CROWDED, at_door=False, lane=lane)
    if applicant.bad_name is not None:
        return Refusal(Close.ABSENT, HTTPStatus.NOT_FOUND, applicant.bad_name)
    found: Grant | Close | None = None
    if isinstance(applicant.who, Close):
        found = applicant.who
    elif applicant.who is not None and applicant.robot is not None:
        found = policy.judge(applicant.who, applicant.robot, applicant.view)
    if applicant.is_preview and isinstance(found, Grant):
        found = replace(found, hz=min(found.hz, PREVIEW_HZ), is_preview=True, past_s=0.0)
    if has_past and isinstance(found, Grant):
        found = replace(found, lane=_find_lane(applicant, policy))
    return REFUSALS[found] if isinstance(found, Close) else found


def _find_lane(applicant: Applicant, policy: Policy) -> str | None:
    """Return the lane of what anyone may see of what they ask for. A picture in a list has none."""
    if applicant.robot is None or applicant.bad_name is not None or applicant.is_preview:
        return None
    return find_lane(policy, applicant.robot, applicant.view)


def find_no_room(grant: Grant | None, occupancy: Occupancy) -> Refusal | None:
    """Why a viewer who may watch can't join now; None when there is room. `grant` None: nobody asked for one.

    A viewer has the place of a preview as well: whoever counts ends one then. A preview has free places only.
    The last step of admission, and its own function: only a hub counts viewers, and only at that moment.
    Who would find room but for the bound of the whole relay is told the lane, where there is one.
    """
    if occupancy.is_draining:
        return DRAINING
    stays = grant is not None and grant.is_preview
    here = occupancy.viewers - (0 if stays else occupancy.previews)
    of_audience = occupancy.of_audience - (0 if stays else occupancy.previews_of_audience)
    is_capped = grant is not None and grant.viewers is not None and of_audience >= grant.viewers
    if here >= occupancy.viewers_max:
        lane = None if grant is None or is_capped else grant.lane
        return FULL if lane is None else replace(FULL, lane=lane)
    return ROBOT_FULL if is_capped else None
