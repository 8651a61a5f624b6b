"""What a process says of its past: how it is kept, what a change of the rules means, and who crowds it."""

from __future__ import annotations

import logging
from collections.abc import Iterator

from posecast_relay.config.robots_file import format_duration
from posecast_relay.config.settings import Settings
from posecast_relay.core.past.memory_store import MemoryPast
from posecast_relay.core.policy.past import compute_kept_longest_s
from posecast_relay.core.policy.policy import Audience, Policy, Rule

log = logging.getLogger("posecast_relay")

CROWD_EVERY_S = 60.0  # one line of a robot


def describe_past(settings: Settings, policy: Policy) -> str:
    """Describe in a line whether and for how long the past is kept."""
    if settings.past is None:
        return "the past: none is kept (--past 0)"
    if settings.role == "gateway":
        return "the past: from Redis"
    kept_s = compute_kept_longest_s(policy)
    if not kept_s:
        return "the past: none is kept, nobody may look back (`past` in the file of robots)"
    return f"the past: {format_duration(kept_s)} in memory, up to {settings.past_memory >> 20} MB"


class PastLog:
    """Writes to the log what changes."""

    def __init__(self) -> None:
        self._policy: Policy | None = None
        self._crowded: dict[str, int] = {}  # by robot, what was told or need not be
        self._told_at: dict[str, float] = {}

    def follow(self, policy: Policy) -> None:
        """Tell which audiences a change of the rules hides a robot from, or lets look back otherwise."""
        before, self._policy = self._policy, policy
        if before is None:
            return
        for robot in sorted({*(before.rules or ()), *(policy.rules or ())}):
            old, new = before.find_rules(robot), policy.find_rules(robot)
            for audience in Audience:
                for line in _list_changes(audience, old.get(audience), new.get(audience)):
                    log.info("%s, %s: %s", robot, audience.value, line)

    def report_crowding(self, kept: MemoryPast, now: float) -> None:
        """Tell of each robot that has lost its oldest since memory is full, once a minute."""
        for robot, count in kept.crowded.items():
            if count == self._crowded.get(robot, 0) or now < self._told_at.get(robot, now):
                continue
            self._crowded[robot], self._told_at[robot] = count, now + CROWD_EVERY_S
            reach = format_duration(round(kept.compute_reach_s(robot, now)))
            log.warning(
                "the past: memory is full (--past-memory, %d MB): %s has most of it, lost its oldest and "
                "reaches back %s",
                kept.bytes_max >> 20,
                robot,
                reach,
            )


def _list_changes(audience: Audience, old: Rule | None, new: Rule | None) -> Iterator[str]:
    if old is None or new is None:
        return  # a table that comes or goes is a robot's or an audience's own end
    if old.blackout != new.blackout:
        yield "blackout begins" if new.blackout else "blackout ends"
    before_s, after_s = old.compute_past_s(audience), new.compute_past_s(audience)
    if before_s != after_s:
        yield f"may look back {format_duration(after_s)}" if after_s else "may not look back any more"
