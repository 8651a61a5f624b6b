"""What is on air, as JSON documents."""

from __future__ import annotations

import json
from typing import Any

from posecast_relay.adapters.store import StateStore
from posecast_relay.core.hub import Hub
from posecast_relay.core.robot import PUBLIC, Robot
from posecast_relay.core.room import Room


def robots_document(hub: Hub, store: StateStore, now: float) -> dict[str, Any]:
    """Every robot whose edge has been heard, here or by those who fill the store, by name."""
    told = store.robots()
    if told is None:
        heard = sorted((r for r in hub.robots.values() if r.heard_at is not None), key=lambda r: r.name)
        told = [robot_summary(r, now) for r in heard]
    return {"robots": [doc | {"viewers": _viewers(doc["robot"], hub, store)} for doc in told]}


def robot_document(robot: Robot, hub: Hub, store: StateStore, now: float) -> dict[str, Any]:
    """One robot with the schema and info of its view."""
    room = _room(robot)
    stream = room.stream if room else None
    schema = stream.schema if stream else None
    return robot_summary(robot, now) | {
        "viewers": _viewers(robot.name, hub, store),
        "conflict": robot.in_conflict,
        "lateness_ms": round(robot.runs.lateness_s * 1000),
        "info": stream.info if stream else {},
        "schema_id": f"{schema.id:08x}" if schema else None,
        "schema": json.loads(schema.text) if schema else None,
    }


def robot_summary(robot: Robot, now: float) -> dict[str, Any]:
    """One robot in a line, as this process knows it."""
    room = _room(robot)
    stream = room.stream if room else None
    age_s = stream.age_s(now) if stream else None
    interval_s = stream.cadence.interval_s if stream else 0.0
    return {
        "robot": robot.name,
        "name": stream.schema.robot if stream and stream.schema else robot.name,
        "status": robot.word(room, now) if room else "silent" if robot.liveness.token else "offline",
        "age_ms": None if age_s is None else max(0, round(age_s * 1000)),
        "seq": stream.newest.seq if stream and stream.newest else None,
        "hz": round(1 / interval_s, 1) if interval_s else None,
        "viewers": robot.viewer_count(),
        "model": stream.model if stream else None,
    }


def _viewers(robot: str, hub: Hub, store: StateStore) -> int:
    """Over all processes."""
    here = hub.robots.get(robot)
    return (here.viewer_count() if here else 0) + store.viewers_elsewhere(robot)


def _room(robot: Robot) -> Room | None:
    """The view that everybody may see."""
    return robot.rooms.get(PUBLIC)
