"""What an audience could not see live though it was meant for it: judged by how the rules changed.

A segment bears the audiences that could see it when it was recorded. Whoever sees a robot late could not see
it yet by then: when a blackout begins, what is on its way to them is never shown live. And a robot that is in
the file no more has no past, also when another gets its name.
"""

from __future__ import annotations

from typing import NamedTuple

from posecast_relay.core.policy.past import Recorded, shows_all
from posecast_relay.core.policy.policy import Audience, Grant, Policy, Rule

SPANS_MAX = 100  # of one audience of a view; then the two oldest become one, with what is between them


class _Span(NamedTuple):
    """Unix ms."""

    from_ms: int
    to_ms: int


class Unseen:
    """What was taken back before it was seen, since this process began. It is told each policy.

    `knows_all`: nothing is kept that was recorded before. If not, who sees late gets nothing of that.
    """

    def __init__(self, knows_all: bool) -> None:
        self._knows_all = knows_all
        self._policy: Policy | None = None
        self._began_ms = 0
        self._gone_ms: dict[str, int] = {}  # by robot: when it was taken out of the file last
        self._spans: dict[tuple[str, str, Audience], list[_Span]] = {}  # by robot, view and audience

    def set_policy(self, policy: Policy, unix_ms: int) -> None:
        """Note what the rules that are in force from `unix_ms` on take back."""
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
        """Whether a segment of the grant's robot and view was taken back before its audience could see it."""
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
