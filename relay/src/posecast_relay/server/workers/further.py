"""A further worker of a relay, started by the first: `python -m …server.workers.further PLACE run …`."""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import logging
import os
import shutil
import signal
import socket
import sys
from collections.abc import Callable
from typing import Any

import uvloop

from posecast_relay.config.settings import Settings, SettingsError, StartError, parse
from posecast_relay.core.delayed_hub import DelayedHub
from posecast_relay.core.hub import Hub
from posecast_relay.core.roster import Headcount
from posecast_relay.http.metrics import RelayCollector
from posecast_relay.logging import LoopExceptionHandler, start_logging
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.server.access import follow_robots, make_access, make_limits, make_watcher
from posecast_relay.server.http_server import RelayServer, make_server_config, settle_memory
from posecast_relay.server.listener import allow_sockets, listen
from posecast_relay.server.robots import wait_for_robots
from posecast_relay.server.workers.fed_source import FedSource
from posecast_relay.server.workers.forwarder import Forwarder
from posecast_relay.server.workers.metrics import serve_worker_metrics
from posecast_relay.server.workers.shared_counts import BEAT_S, DOWN, SERVING, SharedCounts
from posecast_relay.server.workers.worker_place import WorkerPlace
from posecast_relay.streaming.decode_cache import DecodeCache

log = logging.getLogger("posecast_relay")

PR_SET_PDEATHSIG = 1


def main() -> None:
    """Serve until the first worker ends or tells this one to stop."""
    for number in (signal.SIGTERM, signal.SIGINT):  # the first worker handles signals and tells this one
        signal.signal(number, signal.SIG_IGN)
    place = WorkerPlace.unpack(sys.argv[1])
    _die_with_first()
    status = 0
    try:
        settings = parse(sys.argv[2:], os.environ)
        start_logging(settings.log_level, place.number)
        logging.getLogger("websockets").setLevel(logging.WARNING)
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.get_loop().set_exception_handler(LoopExceptionHandler())
            runner.run(_serve(settings, place))
    except (SettingsError, StartError) as e:
        log.error("%s", e)
        status = 2
    os._exit(status)


def _die_with_first() -> None:
    """Let the kernel kill this process when the one that started it ends."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


async def _serve(settings: Settings, place: WorkerPlace) -> None:
    control = socket.socket(fileno=place.control)
    _obey(place, control, lambda: os._exit(0))
    robots = await wait_for_robots(settings)
    allow_sockets(settings.max_viewers, settings.workers)
    counts = SharedCounts(place.counts, place.workers, place.number)
    limits, headcount = make_limits(settings), Headcount(counts)
    hub = Hub(limits, headcount)
    delayed = None if robots is None else DelayedHub(limits, headcount)
    source = _make_source(settings, place, hub, delayed)
    access = make_access(settings, robots, (source, source), hub, delayed, counts)
    try:
        stop_metrics = serve_worker_metrics(place.metrics, RelayCollector(access.dispatchers))
    except OSError as e:
        raise StartError(f"{place.metrics}: {e}") from None
    decoded = DecodeCache()

    def serving() -> None:
        settle_memory()
        counts.set_state(SERVING)

    config = make_server_config(Forwarder(place.door), access, decoded)
    server = RelayServer(config, access.dispatchers, serving)
    _obey(place, control, server.leave)
    for each in access.dispatchers:
        each.start()
    if isinstance(source, FedSource):
        source.start(access.live)
    else:
        await source.start(access.live)
    watch = make_watcher(settings, robots, access, None)
    beside = [
        asyncio.create_task(follow_robots(watch, access), name="robots file"),
        asyncio.create_task(_beat(counts), name="sign of life"),
    ]
    try:
        await server.serve(sockets=[listen(settings.host, place.port, is_shared=True)])
    finally:
        counts.set_state(DOWN)
        for task in beside:
            task.cancel()
        for each in access.dispatchers:
            each.stop()
        stop_metrics()


def _make_source(settings: Settings, place: WorkerPlace, hub: Hub, delayed: DelayedHub | None) -> Any:
    """Make this worker's source of robots: the feed, or Redis for a gateway."""
    pinned = delayed.list_robots if delayed else tuple
    if settings.role != "gateway":
        return FedSource(place.feed, hub, Dispatcher.now, pinned)
    from posecast_relay.redis.gateway import RedisGateway  # noqa: PLC0415 — takes half of the start time

    return RedisGateway(settings.store, hub, Dispatcher.now, pinned)


async def _beat(counts: SharedCounts) -> None:
    while True:
        await asyncio.sleep(BEAT_S)
        counts.beat()


def _obey(place: WorkerPlace, control: socket.socket, leave: Callable[[], None]) -> None:
    """Leave when the first worker says so; exit at once if it is gone."""
    control.setblocking(False)

    def hear() -> None:
        said = b""
        with contextlib.suppress(BlockingIOError, ConnectionError):
            said = control.recv(1)
        if not said:
            shutil.rmtree(place.folder, ignore_errors=True)
            os._exit(0)
        leave()

    asyncio.get_running_loop().add_reader(control, hear)


if __name__ == "__main__":
    main()
