"""Makes the JSON document that the page `/admin` shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from posecast_relay.auth.access import Access
from posecast_relay.config.robots_reader import RobotEntry, Robots, describe_rule
from posecast_relay.core.policy.policy import Audience
from posecast_relay.core.state.robot import Robot
from posecast_relay.http.archive_metrics import ArchiveStats


class MemoryStats(Protocol):
    """Memory that the past uses, and its limit, in bytes."""

    bytes: int
    bytes_max: int


@dataclass(frozen=True)
class AdminSources:
    """Sources of what the page shows.

    `path`: the robots file. `get_robots` returns its version in force. `find_expiries` returns when
    certificates expire, in unix seconds, by flag. `count_refused` returns the number of refused publishers.
    `public_url`: where people open robots, without a slash at its end; None if it is not set.
    """

    path: Path
    get_robots: Callable[[], Robots]
    find_expiries: Callable[[], Mapping[str, float]]
    count_refused: Callable[[], int]
    past: MemoryStats | None
    archive: ArchiveStats | None
    public_url: str | None


def make_report(access: Access, sources: AdminSources, trouble: str | None) -> dict[str, Any]:
    """Return what the page shows now, without secrets. `trouble`: the relay's problem now, in one line."""
    hubs = [dispatcher.hub for dispatcher in access.dispatchers]
    rooms = [room for hub in hubs for robot in hub.robots.values() for room in robot.rooms.values()]
    robots = sources.get_robots().enrolled
    past, archive = sources.past, sources.archive
    # a gateway hears only robots that are watched there; it knows the others from the store
    listed = access.live.store.list_robots()
    told = {doc["robot"]: str(doc["status"]) for doc in listed or ()}
    return {
        "relay": {
            "trouble": trouble,
            "viewers": sum(len(hub.viewers) for hub in hubs),
            "delivered_frames": sum(hub.delivered for hub in hubs) + sum(room.delivered for room in rooms),
            "skipped_frames": sum(hub.skipped for hub in hubs) + sum(room.skipped for room in rooms),
            "refused_publishers": sources.count_refused(),
        },
        "robots": [
            _make_row(access, name, entry, told.get(name))
            | (_compare_views(access, name, entry) if listed is None else {})
            for name, entry in sorted(robots.items())
        ],
        "past": None if past is None else {"bytes": past.bytes, "bytes_max": past.bytes_max},
        "archive": None if archive is None else _describe_archive(archive),
        "certificates": {flag: round(at_s) for flag, at_s in sources.find_expiries().items()},
    }


def _make_row(access: Access, name: str, entry: RobotEntry, told: str | None) -> dict[str, Any]:
    live = access.live
    robot = live.hub.robots.get(name)
    shown = {audience.value: describe_rule(audience, rule) for audience, rule in entry.rules.items()}
    return {
        "robot": name,
        "publishes_by": "certificate" if entry.secret is None else "credential",
        "expires_s": None if entry.expires_s == float("inf") else round(entry.expires_s),
        "audiences": shown,
        "may_link": Audience.LINK in entry.rules,
        "has_links": entry.link_key is not None,
        "viewers": _count_viewers(access, name),
        **(_describe_robot(robot, live.now()) if robot is not None else {"status": told or "offline"}),
    }


def _describe_robot(robot: Robot, now: float) -> dict[str, Any]:
    return {
        "status": robot.compute_status(next(iter(robot.rooms.values()), None), now),
        "conflict": robot.in_conflict,
        "over_share": robot.share.find_exceeded_limit(now),
        "lateness_ms": round(robot.runs.lateness_s * 1000),
    }


def _compare_views(access: Access, name: str, entry: RobotEntry) -> dict[str, Any]:
    """Return the views that a robot sends, and the views that its rules show but it does not send. Empty
    before its first frame. Only for a process to which robots publish: a gateway hears only watched views.
    """
    robot = access.live.hub.robots.get(name)
    rooms = {} if robot is None else robot.rooms  # includes views that viewers asked for but nobody sends
    sent = sorted(view for view, room in rooms.items() if room.stream.schema is not None)
    if not sent:
        return {}
    shown = {audience.value: rule.view for audience, rule in entry.rules.items() if not rule.blackout}
    return {
        "sent_views": sent,
        "unsent_views": {audience: view for audience, view in shown.items() if view not in sent},
    }


def _count_viewers(access: Access, name: str) -> int:
    here = [of for each in access.dispatchers if (of := each.hub.robots.get(name)) is not None]
    return sum(of.count_viewers() for of in here) + access.live.store.count_viewers_elsewhere(name)


def _describe_archive(archive: ArchiveStats) -> dict[str, Any]:
    told = archive.measure()
    return {
        "trouble": told.trouble,
        "stored_bytes": told.stored_bytes,
        "waiting_bytes": told.waiting_bytes,
        "free_bytes": told.free_bytes,
        "disk_bytes": told.disk_bytes,
    }
