"""Log lines about a process's past: how it is kept, what a change of the rules means, who uses most of it."""

from __future__ import annotations

import logging
from collections.abc import Iterator

from posecast_relay.config.robots_reader import format_duration
from posecast_relay.config.settings import Settings
from posecast_relay.core.past.memory_store import MemoryPast
from posecast_relay.core.policy.past import (
    compute_kept_longest_s,
    compute_kept_s,
    compute_recent_s,
    list_idle_keeps,
)
from posecast_relay.core.policy.policy import Audience, Policy, Rule

log = logging.getLogger("posecast_relay")

CROWD_EVERY_S = 60.0  # between two lines about a robot
IDLE_TOLD = 5  # the most robots without a kept past named in the line at the start


def describe_past(settings: Settings, policy: Policy, *, is_new: bool = False) -> str:
    """Describe in a line whether and how long the past is kept. `is_new`: the folder was just created."""
    if settings.past is None:
        return "the past: off (--past 0)"
    archive = describe_archive(settings, policy, " (new, empty)" if is_new else "")
    if settings.role == "gateway":
        return "the past: from Redis" + archive
    kept_s = compute_kept_longest_s(policy, compute_recent_s if settings.archive else compute_kept_s)
    if not kept_s:
        told = "the past: nothing is kept, because nobody may look back (`past` in the file of robots)"
        return told + archive if policy.keeps_s else told
    return f"the past: {format_duration(kept_s)} in memory, up to {settings.past_memory >> 20} MB{archive}"


def describe_archive(settings: Settings, policy: Policy, remark: str = "") -> str:
    """Describe which robots are kept in the object store; empty if there is none. `remark`: about the
    store."""
    if settings.archive is None:
        return ""
    if settings.role == "gateway":
        return f"; before that from {settings.archive}"
    at = f"{settings.archive}{remark}"
    if policy.rules is None:
        return f"; nothing in {at}: `keep` needs a file of robots (--robots)"
    if not policy.keeps_s:
        return f"; nothing in {at}: no robot has `keep` in the file of robots"
    idle = list_idle_keeps(policy)
    kept = ", ".join(
        f"{robot} {format_duration(keep_s)}"
        for robot, keep_s in policy.keeps_s.items()
        if (robot, None) not in idle
    )
    told = f"; in {at}: {kept:.200}" if kept else f"; nothing in {at}"
    return "; ".join([told, *(_describe_idle(*each) for each in idle[:IDLE_TOLD])])


def _describe_idle(robot: str, view: str | None) -> str:
    of, what = repr(robot), "keep" if view is None else f"view {view!r}: keep"
    return f"{what} of {of} has no effect: nobody may look back; give an audience `past`"


class PastLog:
    """Logs changes."""

    def __init__(self) -> None:
        self._policy: Policy | None = None
        self._crowded: dict[str, int] = {}  # by robot, the count that was already logged
        self._told_at: dict[str, float] = {}

    def follow(self, policy: Policy) -> None:
        """Log which audiences can no longer see a robot, or may look back differently, and which `keep` has
        no effect.

        `describe_past` reports the first policy.
        """
        before, self._policy = self._policy, policy
        if before is None:
            return
        idle = list_idle_keeps(policy)
        for robot in sorted({*(before.rules or ()), *(policy.rules or ())}):
            old, new = before.find_rules(robot), policy.find_rules(robot)
            for audience in Audience:
                for line in _list_changes(audience, old.get(audience), new.get(audience)):
                    log.info("%s, %s: %s", robot, audience.value, line)
            if before.keeps_s.get(robot) != policy.keeps_s.get(robot) and (robot, None) not in idle:
                _tell_keep(robot, policy.keeps_s.get(robot))
        if before != policy:
            for each in idle:
                log.warning("%s", _describe_idle(*each))

    def report_crowding(self, kept: MemoryPast, now: float) -> None:
        """Log each robot that has lost its oldest data because memory is full, at most once a minute."""
        for robot, count in kept.crowded.items():
            if count == self._crowded.get(robot, 0) or now < self._told_at.get(robot, now):
                continue
            self._crowded[robot], self._told_at[robot] = count, now + CROWD_EVERY_S
            reach = format_duration(round(kept.compute_reach_s(robot, now)))
            log.warning(
                "the past: memory is full (--past-memory, %d MB): %s uses most of it, lost its oldest "
                "data and reaches back %s",
                kept.bytes_max >> 20,
                robot,
                reach,
            )


def _tell_keep(robot: str, keep_s: float | None) -> None:
    if keep_s is not None:
        log.warning("%s: the store keeps its past for %s", robot, format_duration(keep_s))
        return
    log.warning(
        "%s: `keep` was removed: nothing more is written to the store, and existing data stays until you set "
        "`keep` again or run `posecast-relay past delete`",
        robot,
    )


def _list_changes(audience: Audience, old: Rule | None, new: Rule | None) -> Iterator[str]:
    if old is None or new is None:
        return  # other lines report an added or removed robot or audience
    if old.blackout != new.blackout:
        yield "blackout begins" if new.blackout else "blackout ends"
    before_s, after_s = old.compute_past_s(audience), new.compute_past_s(audience)
    if before_s != after_s:
        yield f"may look back {format_duration(after_s)}" if after_s else "may no longer look back"
