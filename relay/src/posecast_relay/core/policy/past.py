"""Who may look back on what: the rules of today, and those of the time when it was recorded.

A segment bears the names of the audiences that could see all of it live and had a past then. So a rule that
is written later opens nothing of before, and one that is taken back closes everything at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from posecast_relay.core.policy.policy import (
    DELAY_MAX_S,
    EVERYBODY,
    FULL_HZ,
    PAST_S,
    PUBLIC,
    Audience,
    Grant,
    Policy,
    Rule,
)

RECENT_S = PAST_S + DELAY_MAX_S
ComputeKept = Callable[[Policy, str, str], float]


class Recorded(Protocol):
    """A stretch of time that was recorded. `from_ms`, `to_ms`: unix; `audiences`: who could see all of it."""

    @property
    def from_ms(self) -> int:
        """Its beginning."""

    @property
    def to_ms(self) -> int:
        """Its end."""

    @property
    def audiences(self) -> frozenset[Audience]:
        """Who could see all of it live."""


@dataclass(frozen=True)
class PastWindow:
    """What somebody may look back on now, in unix ms: what lies in it as a whole. Empty: `from_ms` is
    `to_ms`."""

    from_ms: int
    to_ms: int

    def compute_left_s(self, from_ms: int) -> float:
        """Return for how many seconds more a segment that began at `from_ms` may be looked at; at least 0."""
        return max(0.0, (from_ms - self.from_ms) / 1000) if self.to_ms > self.from_ms else 0.0


def shows_all(rule: Rule) -> bool:
    """Whether an audience sees each frame by this rule, at once or delayed: a rate below FULL_HZ may leave
    some out, whatever the robot's is just now.
    """
    return not rule.blackout and rule.viewers != 0 and rule.hz >= FULL_HZ


def list_lookers(policy: Policy, robot: str, view: str) -> frozenset[Audience]:
    """Return the audiences that may look back on what a view shows now. None: it need not be recorded.

    They can see all of it live, and their rule gives them a past already.
    """
    return frozenset(
        audience
        for audience, rule in policy.find_rules(robot).items()
        if rule.view == view and shows_all(rule) and rule.compute_past_s(audience) > 0
    )


def compute_kept_s(policy: Policy, robot: str, view: str) -> float:
    """Return for how many seconds after its end a segment of this view may still be asked for.

    0: by nobody, so that nothing of it need be kept. A blackout keeps what is there: it ends.
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
    """Return of what nothing is kept in an object store though the file of robots has `keep`, since nobody
    may look back on it: robots, with a view of theirs, or None where it is all of them. A blackout ends.
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
    """Return for how many seconds a segment of this view is kept in memory or Redis when there is an archive:
    no longer than RECENT_S where the robot's past is in that.
    """
    kept_s = compute_kept_s(policy, robot, view)
    return min(kept_s, RECENT_S) if robot in policy.keeps_s else kept_s


def compute_kept_longest_s(policy: Policy, kept_s: ComputeKept = compute_kept_s) -> float:
    """Return the longest time in seconds for which any segment may still be asked for."""
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
    """Return what a grant lets somebody look back on at `unix_ms`: in its own, delayed time."""
    shown_ms = unix_ms - round(1000 * grant.delay_s)
    return PastWindow(shown_ms - round(1000 * grant.past_s), shown_ms)


def judge_past(grant: Grant, recorded: Recorded, window: PastWindow) -> bool:
    """Whether a segment of the grant's robot and view is for whoever has the grant.

    It lies in the `window`, and the audience by whose rule they see the robot could see all of it live.
    """
    return (
        grant.by in recorded.audiences
        and recorded.from_ms >= window.from_ms
        and recorded.to_ms <= window.to_ms
        and window.to_ms > window.from_ms
    )
