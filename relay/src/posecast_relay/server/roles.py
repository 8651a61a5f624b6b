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
from posecast_relay.models.cache import ModelCache
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.zenoh.ingest import ZenohIngest
from posecast_relay.zenoh.models import EdgeModels
from posecast_relay.zenoh.router import RouterSession


@dataclass(frozen=True)
class RoleServices:
    """What one role does in this process: where models come from, and how it starts and stops."""

    models: ModelCache
    start: Callable[[], Awaitable[None]]
    stop: Callable[[], Awaitable[None]]


def open_part(settings: Settings, router: RouterSession | None, dispatcher: Dispatcher) -> RoleServices:
    """Give the dispatcher its store. `router` is None for a gateway only."""
    cache_bytes = settings.model_cache_mb << 20
    if router is None:
        return _gateway(settings.store, dispatcher, cache_bytes)
    models = ModelCache(EdgeModels(router, dispatcher.hub), cache_bytes)
    ingest = ZenohIngest(router, dispatcher)
    if settings.store == "memory://":

        async def start() -> None:
            ingest.start()

        async def stop() -> None:
            ingest.stop()

        return RoleServices(models, start, stop)
    return _with_redis(settings.store, dispatcher, models, ingest)


def _with_redis(url: str, dispatcher: Dispatcher, models: ModelCache, ingest: ZenohIngest) -> RoleServices:
    from posecast_relay.redis.models import ModelUploader  # noqa: PLC0415 — half of the time to start
    from posecast_relay.redis.store import RedisStore  # noqa: PLC0415

    store = RedisStore(url, dispatcher.hub, dispatcher.now, partial(_described, dispatcher))
    porter = ModelUploader(store.link, dispatcher.hub, models)
    dispatcher.store = store

    async def start() -> None:
        await store.start()
        porter.start()
        ingest.start()

    async def stop() -> None:
        ingest.stop()
        await porter.stop()
        await store.stop()

    return RoleServices(models, start, stop)


def _described(dispatcher: Dispatcher, robot: Robot) -> dict[str, Any]:
    return robot_summary(robot, robot.rooms.get(PUBLIC), dispatcher.now())


def _gateway(url: str, dispatcher: Dispatcher, cache_bytes: int) -> RoleServices:
    from posecast_relay.redis.gateway import RedisGateway  # noqa: PLC0415
    from posecast_relay.redis.models import RedisModels  # noqa: PLC0415 — half of the time to start

    gateway = RedisGateway(url, dispatcher)
    dispatcher.store = gateway
    return RoleServices(
        ModelCache(RedisModels(gateway.link, dispatcher.hub), cache_bytes), gateway.start, gateway.stop
    )
