"""What a process does, by its role: where it hears robots, keeps their state, and finds models.

all       Zenoh → viewers, and → Redis when there is one, so that gateways beside it can serve
ingest    Zenoh → Redis
gateway   Redis → viewers; nothing of its own, so as many as there are viewers
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from posecast_relay.config.settings import Settings
from posecast_relay.core.policy.policy import PUBLIC
from posecast_relay.core.state.robot import Robot
from posecast_relay.http.robots import robot_summary
from posecast_relay.models.cache import Models
from posecast_relay.runtime.dispatcher import Pump
from posecast_relay.zenoh.ingest import ZenohIngest
from posecast_relay.zenoh.models import EdgeModels
from posecast_relay.zenoh.router import Door


@dataclass(frozen=True)
class Part:
    """A role in this process."""

    models: Models
    start: Callable[[], Awaitable[None]]
    stop: Callable[[], Awaitable[None]]


def open_part(settings: Settings, door: Door | None, pump: Pump) -> Part:
    """Gives the pump its store. `door` is None for a gateway only."""
    cache_bytes = settings.model_cache_mb << 20
    if door is None:
        return _gateway(settings.store, pump, cache_bytes)
    models = Models(EdgeModels(door, pump.hub), cache_bytes)
    ingest = ZenohIngest(door, pump)
    if settings.store == "memory://":

        async def start() -> None:
            ingest.start()

        async def stop() -> None:
            ingest.stop()

        return Part(models, start, stop)
    return _with_redis(settings.store, pump, models, ingest)


def _with_redis(url: str, pump: Pump, models: Models, ingest: ZenohIngest) -> Part:
    from posecast_relay.redis.models import ModelPorter  # noqa: PLC0415 — half of the time to start
    from posecast_relay.redis.store import RedisStore  # noqa: PLC0415

    store = RedisStore(url, pump.hub, pump.now, partial(_described, pump))
    porter = ModelPorter(store.link, pump.hub, models)
    pump.store = store

    async def start() -> None:
        await store.start()
        porter.start()
        ingest.start()

    async def stop() -> None:
        ingest.stop()
        await porter.stop()
        await store.stop()

    return Part(models, start, stop)


def _described(pump: Pump, robot: Robot) -> dict[str, Any]:
    return robot_summary(robot, robot.rooms.get(PUBLIC), pump.now())


def _gateway(url: str, pump: Pump, cache_bytes: int) -> Part:
    from posecast_relay.redis.gateway import RedisGateway  # noqa: PLC0415
    from posecast_relay.redis.models import RedisModels  # noqa: PLC0415 — half of the time to start

    gateway = RedisGateway(url, pump)
    pump.store = gateway
    return Part(Models(RedisModels(gateway.link, pump.hub), cache_bytes), gateway.start, gateway.stop)
