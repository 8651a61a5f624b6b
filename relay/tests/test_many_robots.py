"""Many robots at one gateway: listened for while watched, all back after Redis was gone."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from contextlib import AsyncExitStack
from functools import partial
from typing import Any

import pytest
import redis
import zenoh
from posecast_testing import until
from posecast_wire import alive_key, frame_key
from posecast_wire.keys import PREFIX

from .redis_server import Redis
from .sim import Edge, schema
from .stage import Watcher, client_config
from .test_gateway import clean, word

ON_AIR, WATCHED = 220, 200


class Fleet:
    """Robots on one link, each with two frames a second."""

    def __init__(self, endpoint: str, names: list[str]) -> None:
        self._edges = {name: Edge(n + 1, schema(), time.monotonic()) for n, name in enumerate(names)}
        self._session = zenoh.open(client_config(endpoint))
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._keep: list[object] = [
            self._session.declare_queryable(f"{PREFIX}/*/public/snapshot", self._answer),
            *(self._session.liveliness().declare_token(alive_key(name)) for name in names),
        ]
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.is_set():
            for name, edge in self._edges.items():
                with self._lock:
                    payload = edge.frame(time.monotonic())
                stamp = edge.stamp(time.monotonic()).pack()
                self._session.put(frame_key(name, "public"), payload, attachment=stamp)
                self._stop.wait(0.5 / len(self._edges))

    def _answer(self, query: zenoh.Query) -> None:
        name = str(query.key_expr).split("/")[2]
        with self._lock:
            edge = self._edges[name]
            if edge.seq >= 0:
                stamp = edge.stamp(time.monotonic()).pack()
                query.reply(query.key_expr, edge.snapshot().pack(), attachment=stamp)

    def close(self) -> None:
        """All go off air."""
        self._stop.set()
        self._thread.join()
        self._session.close()  # type: ignore[no-untyped-call]


@pytest.fixture
def trio(relays: Any, redis_server: Redis) -> Iterator[tuple[Any, Any]]:
    """A gateway and the names of the robots on air at an ingest beside it."""
    flags = ("--store", redis_server.url)
    ingest = relays("--role", "ingest", *flags)
    gateway = relays("--role", "gateway", *flags)
    names = [f"r{n}" for n in range(ON_AIR)]
    fleet = Fleet(ingest.zenoh, names)
    yield gateway, names
    fleet.close()


def listened(server: Redis) -> set[str]:
    """Robots whose channels somebody listens to."""
    client: Any = redis.Redis(port=server.port, socket_timeout=5)
    found = client.execute_command("PUBSUB", "SHARDCHANNELS")
    return {name.decode().removeprefix("posecast:{").removesuffix("}:live") for name in found}


def goes_on(count: int, viewer: Watcher) -> bool:
    """Whether it has more frames than that, and is told that the robot is online."""
    return len(viewer.frames) > count and word(viewer) == "online"


@pytest.mark.full
async def test_two_hundred_watched_robots(trio: Any, redis_server: Redis) -> None:
    gateway, names = trio
    async with AsyncExitStack() as stack:
        viewers = [await stack.enter_async_context(Watcher(gateway.url(name))) for name in names[:WATCHED]]
        for viewer in viewers:
            await viewer.until("frames", lambda v: len(v.frames) > 3 and word(v) == "online", 30.0)
        assert listened(redis_server) == set(names[:WATCHED])
        await asyncio.to_thread(redis_server.kill)
        for viewer in viewers:
            await viewer.until("degraded", lambda v: word(v) == "degraded", 5.0)
        counts = [len(viewer.frames) for viewer in viewers]
        await asyncio.to_thread(redis_server.start)
        back = time.monotonic()
        for viewer, count in zip(viewers, counts, strict=True):
            await viewer.until("frames again", partial(goes_on, count))
        print(f"{WATCHED} robots back {time.monotonic() - back:.1f} s after Redis")
        assert listened(redis_server) == set(names[:WATCHED])
        for viewer in viewers:
            clean(viewer)
        for viewer in viewers[10:]:
            assert viewer.connection is not None
            await viewer.connection.close()
        left = set(names[:10])
        await asyncio.to_thread(until, "let go of", lambda: listened(redis_server) == left, 30.0)
