"""Connects a process, by its role, to the sources of robots, their state and their models.

all       Zenoh → viewers, and → Redis if there is one, so that gateways can serve too
ingest    Zenoh → Redis
gateway   Redis → viewers; stateless, so you can run as many as your viewers need
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass
from typing import Any

from posecast_relay.config.settings import Settings
from posecast_relay.core.hub import Hub
from posecast_relay.core.policy import PUBLIC
from posecast_relay.core.robot import Robot
from posecast_relay.http.robots import make_robot_summary
from posecast_relay.models.cache import ModelCache
from posecast_relay.runtime.dispatcher import Dispatcher, MemoryStore, RobotSource, StateStore
from posecast_relay.server.past import PastServices
from posecast_relay.zenoh.ingest import ZenohIngest
from posecast_relay.zenoh.models import EdgeModels
from posecast_relay.zenoh.router import RouterSession


@dataclass(frozen=True)
class RoleServices:
    """The services of a role in this process: the sources of robots, their state and their models.

    `start` feeds the dispatcher's hub. `admit` lets only these robots publish, by name and secret.
    """

    models: ModelCache
    store: StateStore
    source: RobotSource
    start: Callable[[Dispatcher], Awaitable[None]]
    stop: Callable[[], Awaitable[None]]
    admit: Callable[[dict[str, str]], Awaitable[None]]


def make_role_services(
    settings: Settings,
    router: RouterSession | None,
    hub: Hub,
    past: PastServices,
    pinned: Callable[[], Iterable[str]],
) -> RoleServices:
    """Make the services of the role in `settings`.

    `router` is None only for a gateway. `past` may have models too, and keeps those that it refers to.
    `pinned` names robots that a gateway hears even if nobody watches.
    """
    services = _make(settings, router, hub, pinned, past)
    past.keep_models(services.models)
    return services


def _make(
    settings: Settings,
    router: RouterSession | None,
    hub: Hub,
    pinned: Callable[[], Iterable[str]],
    past: PastServices,
) -> RoleServices:
    cache_bytes = settings.model_cache_mb << 20
    if router is None:
        return _gateway(settings.store, hub, cache_bytes, pinned, past)
    models = ModelCache(past.join_models(EdgeModels(router, hub)), cache_bytes)
    connect = STORES[settings.store.partition("://")[0]]
    return connect(settings.store, hub, models, ZenohIngest(router))


def _in_memory(_url: str, _hub: Hub, models: ModelCache, ingest: ZenohIngest) -> RoleServices:
    async def start(dispatcher: Dispatcher) -> None:
        ingest.start(dispatcher)

    async def stop() -> None:
        ingest.stop()

    return RoleServices(models, MemoryStore(), ingest, start, stop, ingest.admit)


def _with_redis(url: str, hub: Hub, models: ModelCache, ingest: ZenohIngest) -> RoleServices:
    from posecast_relay.redis.models import ModelUploader  # noqa: PLC0415 — half of the time to start
    from posecast_relay.redis.store import RedisStore  # noqa: PLC0415

    store = RedisStore(url, hub, Dispatcher.now, _describe_robot)
    porter = ModelUploader(store.link, hub, models)

    async def start(dispatcher: Dispatcher) -> None:
        await store.start()
        porter.start()
        ingest.start(dispatcher)

    async def stop() -> None:
        ingest.stop()
        await porter.stop()
        await store.stop()

    return RoleServices(models, store, ingest, start, stop, ingest.admit)


# scheme of --store, which config/settings.py checks → connects the robots that this process hears to it
STORES: dict[str, Callable[[str, Hub, ModelCache, ZenohIngest], RoleServices]] = {
    "memory": _in_memory,
    "redis": _with_redis,
    "rediss": _with_redis,
    "redis+cluster": _with_redis,
}


def _describe_robot(robot: Robot) -> dict[str, Any]:
    return make_robot_summary(robot, robot.rooms.get(PUBLIC), Dispatcher.now())


def _gateway(
    url: str, hub: Hub, cache_bytes: int, pinned: Callable[[], Iterable[str]], past: PastServices
) -> RoleServices:
    from posecast_relay.redis.gateway import RedisGateway  # noqa: PLC0415
    from posecast_relay.redis.models import RedisModels  # noqa: PLC0415 — half of the time to start

    async def admit(_secrets: dict[str, str]) -> None:
        """Do nothing: nobody publishes to a gateway."""

    gateway = RedisGateway(url, hub, Dispatcher.now, pinned)
    models = ModelCache(past.join_models(RedisModels(gateway.link, hub)), cache_bytes)
    return RoleServices(models, gateway, gateway, gateway.start, gateway.stop, admit)
