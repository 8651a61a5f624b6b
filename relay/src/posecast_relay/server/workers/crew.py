"""The first worker's side of a relay with several workers: opens their sockets and joins their results."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import uvicorn
from prometheus_client.registry import Collector

from posecast_relay.auth.access import Access
from posecast_relay.config.settings import Settings, StartError
from posecast_relay.core.hub import Hub
from posecast_relay.http.app import MissingPart
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.server.http_server import RelayServer
from posecast_relay.server.listener import BACKLOG, is_served
from posecast_relay.server.workers.feed import Feed, FeedStore
from posecast_relay.server.workers.metrics import JoinedCollector
from posecast_relay.server.workers.private_door import make_private_http_protocol
from posecast_relay.server.workers.shared_counts import (
    BEAT_S,
    DOWN,
    SERVING,
    SharedCounts,
    open_shared_memory,
)
from posecast_relay.server.workers.supervisor import Supervisor
from posecast_relay.server.workers.worker_place import WorkerPlace
from posecast_relay.store import StateStore

PREFIX = "posecast-relay-"
LOOK_S = 0.05


class Crew:
    """A relay's workers, as seen by the first one. `argv`: the arguments of the first worker."""

    def __init__(self, settings: Settings, argv: Sequence[str], port: int) -> None:
        """Raises StartError if the shared memory can't be made."""
        try:
            _remove_left()
            self._folder = Path(tempfile.mkdtemp(prefix=PREFIX))
            memory = open_shared_memory(settings.workers)
            self.counts = SharedCounts(memory, settings.workers, 0)
        except OSError as e:
            raise StartError(f"--workers {settings.workers}: {(e.strerror or str(e)).lower()}") from None
        self._settings = settings
        place = WorkerPlace(0, settings.workers, port, str(self._folder), memory, -1)
        self._place = place
        self.supervisor = Supervisor(argv, place, self.counts)
        self._feed: Feed | None = None
        self._door: asyncio.Server | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self._has_begun = False  # all workers have served

    def join_store(self, store: StateStore, hub: Hub) -> StateStore:
        """Return a store that also feeds the other workers. A gateway's workers read Redis instead."""
        if self._settings.role == "gateway":
            return store
        self._feed = Feed(self._place.feed, hub, Dispatcher.now, self.counts)
        return FeedStore(store, self._feed, self.counts)

    def join_metrics(self, own: Collector) -> Collector:
        """Return the metrics of all workers."""
        workers, missing = self._settings.workers, self.counts.list_missing
        return JoinedCollector(own, self._folder, workers, missing, lambda: self.supervisor.restarts)

    def find_missing(self) -> MissingPart | None:
        """Return the workers that don't serve; None if all do. A relay has begun once all have served."""
        missing = self.counts.list_missing()
        if not missing:
            return None
        why = f"not serving: worker {', '.join(map(str, missing))} of {self._settings.workers}"
        return MissingPart(why, self._has_begun)

    async def start(self, server: RelayServer, app: Any, access: Access) -> None:
        """Open the private socket and the feed, and start the other workers. Raises StartError."""
        try:
            if self._feed is not None:
                await self._feed.start()
            await self._open_door(server, app, access)
        except OSError as e:
            raise StartError(f"--workers {self._settings.workers}: {self._folder}: {e}") from None
        server.before_leaving(self.supervisor.drain)
        server.end_after(lambda: self.supervisor.is_over)
        self.supervisor.start()
        self._tasks.append(asyncio.create_task(self._beat(), name="sign of life"))

    def tell_when_serving(self, tell: Callable[[], None]) -> None:
        """Call `tell` once, as soon as all workers serve."""

        async def wait() -> None:
            while self.counts.list_missing():
                await asyncio.sleep(LOOK_S)
            self._has_begun = True
            tell()

        self.counts.set_state(SERVING)
        self._tasks.append(asyncio.create_task(wait(), name="all serve"))

    def stop(self) -> None:
        """Stop everything."""
        self.counts.set_state(DOWN)
        for task in self._tasks:
            task.cancel()
        self.supervisor.stop()
        if self._door is not None:
            self._door.close()
        if self._feed is not None:
            self._feed.stop()
        shutil.rmtree(self._folder, ignore_errors=True)

    async def _beat(self) -> None:
        while True:
            await asyncio.sleep(BEAT_S)
            self.counts.beat()

    async def _open_door(self, server: uvicorn.Server, app: Any, access: Access) -> None:
        config = uvicorn.Config(
            app,
            ws="none",
            http=make_private_http_protocol(access),
            lifespan="off",
            log_config=None,
            access_log=False,
            server_header=False,
        )
        config.load()

        def make() -> asyncio.Protocol:
            state = server.server_state
            return config.http_protocol_class(config=config, server_state=state, app_state={})  # type: ignore[call-arg]

        door = str(self._place.door)
        self._door = await asyncio.get_running_loop().create_unix_server(make, path=door, backlog=BACKLOG)


def _remove_left() -> None:
    """Remove folders left by relays that were killed."""
    for door in Path(tempfile.gettempdir()).glob(f"{PREFIX}*/http"):
        with contextlib.suppress(OSError):
            if not is_served(door):
                shutil.rmtree(door.parent, ignore_errors=True)
