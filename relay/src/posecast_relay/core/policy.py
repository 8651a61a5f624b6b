"""Who may see what, live and of the past, and who is let in: pure functions.

A robot has one rule per audience. A caller without proof is `anyone`; a share link or a sign-in takes
precedence. If no rule admits a caller, the robot looks like one that does not exist.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import math
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from http import HTTPStatus
from typing import Protocol

from posecast_wire import Close

PUBLIC = "public"  # the default view, unless a profile defines others
DELAY_MAX_S = 60.0
FULL_HZ = 60.0  # the highest live rate: a rule with a lower rate may skip frames
PAST_S = 1800.0  # how far back an audience with live access may look by default


class Audience(StrEnum):
    """The kind of caller, by the proof it gave. The values are the names used in the file of `--robots`."""

    ANYONE = "anyone"
    SIGNED_IN = "signed-in"
    LINK = "link"


@dataclass(frozen=True)
class Rule:
    """What an audience may see of a robot. `viewers`: of this audience at a time, in this process.

    `frames`: origins of pages that may embed what `anyone` sees; None: any page. `past_s`: how far back it
    may look, in seconds; None: not set.
    """

    view: str = PUBLIC
    hz: float = FULL_HZ
    delay_s: float = 0.0
    viewers: int | None = None
    blackout: bool = False
    frames: tuple[str, ...] | None = None
    past_s: float | None = None

    def compute_past_s(self, audience: Audience) -> float:
        """Return how far back `audience` may look under this rule, in seconds.

        0 if frames may be skipped, because segments hold all frames. Also 0 by default for share links and
        for delayed views.
        """
        if self.hz < FULL_HZ:
            return 0.0
        if self.past_s is not None:
            return self.past_s
        return 0.0 if audience is Audience.LINK or self.delay_s > 0 else PAST_S


@dataclass(frozen=True)
class Principal:
    """A caller, as its `token` proves. `robot`: the one that a share link opens. `until_s`: unix s."""

    audience: Audience = Audience.ANYONE
    robot: str | None = None
    until_s: float = float("inf")
    token: str = field(default="", repr=False)


ANYONE = Principal()


@dataclass(frozen=True)
class Grant:
    """What a caller may see: one view of a robot, the rate, the delay, the past, and the audience whose rule
    applies."""

    robot: str
    view: str
    hz: float
    delay_s: float
    viewers: int | None
    by: Audience
    who: Principal
    past_s: float = 0.0  # how far back from what is shown live; 0: no past
    lane: str | None = None  # where they read on if the relay is full

    @property
    def open(self) -> bool:
        """Whether the rule is that of `anyone`, so that any page may read the response."""
        return self.by is Audience.ANYONE


Rules = Mapping[str, Mapping[Audience, Rule]]  # by robot
EVERYBODY: Mapping[Audience, Rule] = {Audience.ANYONE: Rule()}


@dataclass(frozen=True)
class Policy:
    """The rules of all robots. `rules` None: every robot's public view is open, as with --dev.

    `keeps_s`: for how many seconds an object store keeps a robot's past, by robot; other robots are not
    stored.
    """

    rules: Rules | None = None
    keeps_s: Mapping[str, float] = field(default_factory=dict)

    def find_rules(self, robot: str) -> Mapping[Audience, Rule]:
        """Return the rules of one robot by audience; empty for an unlisted robot."""
        return EVERYBODY if self.rules is None else self.rules.get(robot, {})

    def judge(self, who: Principal, robot: str, view: str | None = None) -> Grant | Close:
        """Return what `who` may see of a robot.

        ABSENT if they may see nothing; FORBIDDEN if they may see another view but not `view`.
        """
        rules = self.find_rules(robot)
        found = [
            Grant(
                robot=robot,
                view=rule.view,
                hz=rule.hz,
                delay_s=rule.delay_s,
                viewers=rule.viewers,
                by=audience,
                who=who,
                past_s=rule.compute_past_s(audience),
            )
            for audience in dict.fromkeys((who.audience, Audience.ANYONE))
            if (rule := rules.get(audience)) is not None
            and not rule.blackout
            and (audience is not Audience.LINK or who.robot == robot)
        ]
        if not found:
            return Close.ABSENT
        return next((grant for grant in found if view in (None, grant.view)), Close.FORBIDDEN)

    def list_frame_ancestors(self, robot: str, listed: Collection[str]) -> tuple[str, ...]:
        """Return the pages that may embed a robot, as sources of CSP's `frame-ancestors`; `robot` "": any
        robot.

        `listed`: external pages that may show restricted data. A request for a frame carries no proof yet, so
        a hidden robot gets the same answer as one that does not exist.
        """
        rule = self.find_rules(robot).get(Audience.ANYONE)
        if rule is None or rule.blackout:
            return ("'self'", *listed)
        return ("*",) if rule.frames is None else ("'self'", *rule.frames)

    def find_delays_s(self) -> dict[tuple[str, str], float]:
        """Return the delays of the delayed views in seconds, by robot and view."""
        return {
            (robot, rule.view): rule.delay_s
            for robot, rules in (self.rules or {}).items()
            for rule in rules.values()
            if rule.delay_s > 0
        }


LINK_KIND = "L1"
LINK_FORM = re.compile(
    r"(L1\.([a-z0-9][a-z0-9-]{0,62})\.([1-9][0-9]{0,11})\.[A-Za-z0-9_-]{8})\.([A-Za-z0-9_-]{43})"
)
NO_KEY = "no such robot"  # signs nothing; makes the check for an unknown robot take the same time


def make_link(key: str, robot: str, until_s: int, name: str) -> str:
    """Sign a link that opens `robot` until `until_s`, unix s.

    `name`: 8 letters of base64url that make the link unique.
    """
    signed = f"{LINK_KIND}.{robot}.{until_s}.{name}"
    return f"{signed}.{_sign(key, signed)}"


def is_link(token: str) -> bool:
    """Whether a token looks like a share link. Does not check its signature."""
    return token.startswith(LINK_KIND + ".")


def read_link(token: str, keys: Mapping[str, str], unix_s: float) -> Principal | None:
    """Return the holder of the link; None if it is malformed, wrongly signed or expired. `keys`: by robot."""
    found = LINK_FORM.fullmatch(token)
    if found is None:
        return None
    signed, robot, until_s, signature = found.groups()
    key = keys.get(robot)
    good = hmac.compare_digest(_sign(NO_KEY if key is None else key, signed), signature)
    if key is None or not good or unix_s >= int(until_s):
        return None
    return Principal(Audience.LINK, robot, float(until_s), token)


def _sign(key: str, signed: str) -> str:
    raw = hmac.digest(key.encode(), signed.encode(), hashlib.sha256)
    return base64.urlsafe_b64encode(raw).rstrip(b"=").decode()


# Who may look back on what, by today's rules and those in force at the time of recording.
#
# A segment lists the audiences that could see all of it live and had a past at that time. So a new rule never
# opens older data, and a revoked rule closes everything at once.

RECENT_S = PAST_S + DELAY_MAX_S
ComputeKept = Callable[[Policy, str, str], float]


class Recorded(Protocol):
    """A recorded time span. `from_ms`, `to_ms`: unix ms; `audiences`: those that could see all of it live."""

    @property
    def from_ms(self) -> int:
        """Its start, unix ms."""

    @property
    def to_ms(self) -> int:
        """Its end, unix ms."""

    @property
    def audiences(self) -> frozenset[Audience]:
        """The audiences that could see all of it live."""


@dataclass(frozen=True)
class PastWindow:
    """The time span, unix ms, that a caller may look back on now. It is empty if `from_ms` equals `to_ms`."""

    from_ms: int
    to_ms: int

    def compute_left_s(self, from_ms: int) -> float:
        """Return how many more seconds a segment that began at `from_ms` stays visible; at least 0."""
        return max(0.0, (from_ms - self.from_ms) / 1000) if self.to_ms > self.from_ms else 0.0


def shows_all(rule: Rule) -> bool:
    """Whether a rule shows an audience every frame, live or delayed.

    A rate below FULL_HZ may skip frames, whatever the robot's current rate is.
    """
    return not rule.blackout and rule.viewers != 0 and rule.hz >= FULL_HZ


def list_lookers(policy: Policy, robot: str, view: str) -> frozenset[Audience]:
    """Return the audiences that may look back on what a view shows now. If empty, it need not be recorded.

    They see all of it live, and their rule already gives them a past.
    """
    return frozenset(
        audience
        for audience, rule in policy.find_rules(robot).items()
        if rule.view == view and shows_all(rule) and rule.compute_past_s(audience) > 0
    )


def compute_kept_s(policy: Policy, robot: str, view: str) -> float:
    """Return for how many seconds after its end a segment of this view can still be requested.

    0: nobody can request it, so it need not be kept. A blackout is temporary and does not shorten this.
    """
    return max(
        (
            past_s + rule.delay_s
            for audience, rule in policy.find_rules(robot).items()
            if rule.view == view and (past_s := rule.compute_past_s(audience)) > 0
        ),
        default=0.0,
    )


def list_idle_keeps(policy: Policy) -> list[tuple[str, str | None]]:
    """Return the robots, with a view or None for all views, whose `keep` has no effect.

    The file of robots has `keep` for them, but nobody may look back on them, so nothing is stored. A blackout
    does not count, because it is temporary.
    """
    found: list[tuple[str, str | None]] = []
    for robot in policy.keeps_s:
        rules = policy.find_rules(robot)
        views = sorted({rule.view for rule in rules.values()})
        looked = {
            rule.view
            for audience, rule in rules.items()
            if rule.viewers != 0 and rule.compute_past_s(audience) > 0
        }
        found += [(robot, view) for view in views if view not in looked] if looked else [(robot, None)]
    return found


def compute_recent_s(policy: Policy, robot: str, view: str) -> float:
    """Return for how many seconds memory or Redis keeps a segment of this view if there is an archive.

    At most RECENT_S if the archive keeps this robot's past.
    """
    kept_s = compute_kept_s(policy, robot, view)
    return min(kept_s, RECENT_S) if robot in policy.keeps_s else kept_s


def compute_kept_longest_s(policy: Policy, kept_s: ComputeKept = compute_kept_s) -> float:
    """Return the longest time in seconds for which any segment can still be requested."""
    if policy.rules is None:
        return max(rule.compute_past_s(audience) for audience, rule in EVERYBODY.items())
    return max(
        (
            kept_s(policy, robot, view)
            for robot, rules in policy.rules.items()
            for view in {PUBLIC, *(rule.view for rule in rules.values())}
        ),
        default=0.0,
    )


def find_past_window(grant: Grant, unix_ms: int) -> PastWindow:
    """Return what a grant may look back on at `unix_ms`, taking its delay into account."""
    shown_ms = unix_ms - round(1000 * grant.delay_s)
    return PastWindow(shown_ms - round(1000 * grant.past_s), shown_ms)


def is_past_shown(grant: Grant, recorded: Recorded, window: PastWindow) -> bool:
    """Whether a grant may see a segment of its robot and view.

    The segment must lie in the `window`, and the grant's audience must have been able to see all of it live.
    """
    return (
        grant.by in recorded.audiences
        and recorded.from_ms >= window.from_ms
        and recorded.to_ms <= window.to_ms
        and window.to_ms > window.from_ms
    )


# The lane: where viewers can read on when the relay is full.
#
# The lane serves the public past as segments over HTTP, through any cache. It is offered only if those
# segments show exactly what `anyone` sees live.

LANE_PAST_S = 15.0  # a segment lasts at most 6 s, and a request for the next one may be 9 s late
TRIES_PER_S = 20.0  # attempts of lane readers to get a stream: each refusal costs half a millisecond
PACE_S = 60.0  # the time over which arrivals are counted
RETRY_S_MAX = 600.0

NO_PAST = "this process keeps no past (--past 0)"
NOT_OPEN = "`anyone` may not see it"
DELAYED = "`anyone` sees it with a delay"
NOT_ALL = "`anyone` gets a reduced rate (`hz`)"
NO_LOOK_BACK = f"`anyone` may look back less than {LANE_PAST_S:g} s (`past`)"
CAPPED = "its own rule limits the viewers (`viewers`)"


def find_lane(policy: Policy, robot: str, view: str | None) -> str | None:
    """Return the lane's address as sent in `bye`, relative to that of the stream; None if there is no lane.

    `view` None: any view that `anyone` may see. The lane may not have a segment yet.
    """
    return (
        None
        if explain_no_lane(policy, robot, view)
        else f"past/{policy.find_rules(robot)[Audience.ANYONE].view}"
    )


def explain_no_lane(policy: Policy, robot: str, view: str | None) -> str | None:
    """Return why the rules give a robot and view no lane, for the log; None if they have one."""
    rule = policy.find_rules(robot).get(Audience.ANYONE)
    if rule is None or rule.blackout or rule.viewers == 0 or view not in (None, rule.view):
        return NOT_OPEN
    if rule.delay_s > 0:
        return DELAYED
    if not shows_all(rule):
        return NOT_ALL
    return None if rule.compute_past_s(Audience.ANYONE) >= LANE_PAST_S else NO_LOOK_BACK


class RetryPace:
    """Decides when viewers in the lane retry a stream: the more there are, the longer each waits.

    Otherwise the load on a full relay would grow with the number of lane readers, although caches serve them.
    """

    def __init__(self) -> None:
        self._came = 0.0  # recent arrivals, weighted down with age
        self._at = 0.0

    def choose_retry_s(self, least_s: float, now: float) -> float:
        """Count one more viewer sent to the lane, and return in how many seconds it may retry."""
        self._came = self._came * math.exp((self._at - now) / PACE_S) + 1.0
        self._at = now
        return max(least_s, min(RETRY_S_MAX, float(round(self._came / TRIES_PER_S))))


# Decides who is let in: one pure function for WebSockets, event streams and every HTTP route.
#
# Facts that need I/O (an address, a token) are passed in as values once they are known. A caller may be
# judged again when more is known. A refusal holds everything that each kind of connection needs.

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


def _refuse_for_now(reason: str, at_door: bool = False) -> Refusal:
    return Refusal(Close.FULL, HTTPStatus.SERVICE_UNAVAILABLE, reason, FULL_RETRY_S, at_door)


# Refusals of a page's origin or of an address come before a WebSocket begins.
FOREIGN = Refusal(
    Close.FORBIDDEN, HTTPStatus.FORBIDDEN, "pages of this origin may not use it", None, at_door=True
)
CROWDED = _refuse_for_now("too many streams from this address", at_door=True)
# Refusals because of a token or the policy, by close code.
REFUSALS = {
    refusal.close: refusal
    for refusal in (
        Refusal(Close.TOKEN, HTTPStatus.UNAUTHORIZED, "the link or sign-in is invalid or has expired"),
        Refusal(Close.ABSENT, HTTPStatus.NOT_FOUND, HIDDEN),
        Refusal(Close.FORBIDDEN, HTTPStatus.FORBIDDEN, "you may not see this view"),
        _refuse_for_now("your sign-in can't be checked right now"),
        Refusal(
            Close.INTERNAL_ERROR,
            HTTPStatus.INTERNAL_SERVER_ERROR,
            "internal error of the relay at this connection",
        ),
    )
}
# Refusals because of the viewers that are already here.
DRAINING = Refusal(Close.DRAIN, HTTPStatus.SERVICE_UNAVAILABLE, GOING, DRAIN_RETRY_S)
FULL = _refuse_for_now("the relay has no room for more viewers")
ROBOT_FULL = _refuse_for_now("this robot has no room for more viewers")


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
