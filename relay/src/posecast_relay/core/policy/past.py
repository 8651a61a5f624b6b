"""Who may look back on what, by today's rules and those in force at the time of recording.

A segment lists the audiences that could see all of it live and had a past at that time. So a new rule never
opens older data, and a revoked rule closes everything at once.
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


def judge_past(grant: Grant, recorded: Recorded, window: PastWindow) -> bool:
    """Whether a grant may see a segment of its robot and view.

    The segment must lie in the `window`, and the grant's audience must have been able to see all of it live.
    """
    return (
        grant.by in recorded.audiences
        and recorded.from_ms >= window.from_ms
        and recorded.to_ms <= window.to_ms
        and window.to_ms > window.from_ms
    )
