"""Tracks recordings that an audience was meant to see but never saw live, because the rules changed first.

A segment lists the audiences that could see it when it was recorded. An audience with a delay has not seen it
yet at that moment. If a blackout begins, the delayed data is never shown live. A robot that is no longer in
the file has no past, even if another robot gets its name.
"""

from __future__ import annotations

from typing import NamedTuple

from posecast_relay.core.policy import Audience, Grant, Policy, Recorded, Rule, shows_all

SPANS_MAX = 100  # per audience of a view; beyond that the two oldest merge, with the gap between them


class _Span(NamedTuple):
    """A time span, unix ms."""

    from_ms: int
    to_ms: int


class Unseen:
    """What was withdrawn before it was seen, since this process started. It needs each new policy.

    `knows_all`: no recordings predate this process. Otherwise delayed audiences get none of those.
    """

    def __init__(self, knows_all: bool) -> None:
        self._knows_all = knows_all
        self._policy: Policy | None = None
        self._began_ms = 0
        self._gone_ms: dict[str, int] = {}  # by robot: when it was last removed from the file
        self._spans: dict[tuple[str, str, Audience], list[_Span]] = {}  # by robot, view and audience

    def set_policy(self, policy: Policy, unix_ms: int) -> None:
        """Note what the rules in force from `unix_ms` on withdraw."""
        before, self._policy = self._policy, policy
        if before is None:
            self._began_ms = unix_ms
            return
        for robot, rules in (before.rules or {}).items():
            if policy.rules is not None and robot not in policy.rules:
                self._gone_ms[robot] = unix_ms
            for audience, rule in rules.items():
                after = policy.find_rules(robot).get(audience)
                if _shows_late(rule) and not (after and after.view == rule.view and _shows_late(after)):
                    self._add(
                        (robot, rule.view, audience), _Span(unix_ms - round(1000 * rule.delay_s), unix_ms)
                    )

    def has(self, grant: Grant, recorded: Recorded) -> bool:
        """Whether a segment of the grant's robot and view was withdrawn before its audience could see it."""
        began_ms = 0 if self._knows_all or grant.delay_s == 0 else self._began_ms
        return recorded.from_ms < max(began_ms, self._gone_ms.get(grant.robot, 0)) or any(
            recorded.from_ms <= span.to_ms and recorded.to_ms > span.from_ms
            for span in self._spans.get((grant.robot, grant.view, grant.by), ())
        )

    def _add(self, key: tuple[str, str, Audience], span: _Span) -> None:
        spans = self._spans.setdefault(key, [])
        spans.append(span)
        if len(spans) > SPANS_MAX:
            spans[:2] = [_Span(min(spans[0].from_ms, spans[1].from_ms), max(spans[0].to_ms, spans[1].to_ms))]


def _shows_late(rule: Rule) -> bool:
    return rule.delay_s > 0 and shows_all(rule)
