"""What a process does, by its role: where it hears robots, keeps their state, and finds models.

all       Zenoh → viewers, and → Redis when there is one, so that gateways beside it can serve
ingest    Zenoh → Redis
gateway   Redis → viewers; nothing of its own, so as many as there are viewers
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass

import zenoh

from posecast_relay.adapters.models import Models
from posecast_relay.adapters.models_edge import EdgeModels
from posecast_relay.adapters.pump import Pump
from posecast_relay.adapters.zenoh_ingest import ZenohIngest
from posecast_relay.config import Settings
from posecast_relay.listing import robot_summary


@dataclass(frozen=True)
class Part:
    """A role in this process."""

    models: Models
    start: Callable[[], Awaitable[None]]
    stop: Callable[[], Awaitable[None]]


def open_part(settings: Settings, session: zenoh.Session | None, pump: Pump) -> Part:
    """Gives the pump its store. `session` is None for a gateway only."""
    cache_bytes = settings.model_cache_mb << 20
    if session is None:
        return _gateway(settings.store, pump, cache_bytes)
    models = Models(EdgeModels(session, pump.hub), cache_bytes)
    ingest = ZenohIngest(session, pump)
    if settings.store == "memory://":

        async def start() -> None:
            ingest.start()

        return Part(models, start, pump.store.stop)
    return _with_redis(settings.store, pump, models, ingest)


def _with_redis(url: str, pump: Pump, models: Models, ingest: ZenohIngest) -> Part:
    from posecast_relay.adapters.models_redis import ModelPorter  # noqa: PLC0415 — half of the time to start
    from posecast_relay.adapters.store_redis import RedisStore  # noqa: PLC0415

    store = RedisStore(url, pump.hub, pump.now, lambda robot: robot_summary(robot, pump.now()))
    porter = ModelPorter(store.link, pump.hub, models)
    pump.store = store

    async def start() -> None:
        await store.start()
        porter.start()
        ingest.start()

    async def stop() -> None:
        await porter.stop()
        await store.stop()

    return Part(models, start, stop)


def _gateway(url: str, pump: Pump, cache_bytes: int) -> Part:
    from posecast_relay.adapters.models_redis import RedisModels  # noqa: PLC0415 — half of the time to start
    from posecast_relay.adapters.redis_gateway import RedisGateway  # noqa: PLC0415

    gateway = RedisGateway(url, pump)
    pump.store = gateway
    return Part(Models(RedisModels(gateway.link, pump.hub), cache_bytes), gateway.start, gateway.stop)
