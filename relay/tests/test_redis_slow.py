"""Redis slow, frozen and dead: who hears the robot misses nothing, who does not says so and comes back."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import Any

from posecast_testing import free_port

from .redis_server import Redis
from .test_gateway import clean, live_after, watching, word
from .test_observability import figures


class SlowLine:
    """In front of a port: every piece of data is under way for `delay_s`, each way. On connections opened
    from now on, for `further_s` more."""

    def __init__(self, to: int) -> None:
        self.delay_s = self.further_s = 0.0
        self.port = 0
        self._to = to

    @property
    def url(self) -> str:
        """Of a Redis behind it."""
        return f"redis://127.0.0.1:{self.port}"

    @asynccontextmanager
    async def open(self) -> AsyncIterator[SlowLine]:
        """Until the end of the block."""
        server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        self.port = server.sockets[0].getsockname()[1]
        try:
            yield self
        finally:
            server.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            there, back = await asyncio.open_connection("127.0.0.1", self._to)
            further_s = self.further_s
            await asyncio.gather(self._pass(reader, back, further_s), self._pass(there, writer, further_s))
        writer.close()

    async def _pass(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, further_s: float
    ) -> None:
        loop = asyncio.get_running_loop()
        with suppress(OSError):
            while data := await reader.read(65536):
                loop.call_later(self.delay_s + further_s, writer.write, data)
        loop.call_later(self.delay_s + further_s, writer.close)


async def test_all_misses_nothing_while_redis_is_slow_frozen_and_dead(
    relays: Any, edges: Any, redis_server: Redis
) -> None:
    port = free_port()
    async with SlowLine(redis_server.port).open() as line:
        relay = await asyncio.to_thread(relays, "--store", line.url, "--metrics-port", str(port))
        beside = await asyncio.to_thread(relays, "--role", "gateway", "--store", line.url)
        edge = await asyncio.to_thread(edges, relay.zenoh)
        async with watching(relay, beside, query="?hz=60") as (viewer, other):
            for each in (viewer, other):
                await each.until("frames", lambda v: len(v.frames) > 20)
            # a loaded machine costs time and no frame: what the first viewer lacks then, the relay has lost
            edge.waits = lambda: viewer.frames[-1][1].seq < edge.seq
            first = viewer.frames[-1][1].seq + 2

            async def through(harm: Callable[[], object], degraded: bool, mend: Callable[[], object]) -> None:
                seq = edge.seq
                await asyncio.to_thread(harm)
                # 4 a second if it waited for Redis
                await viewer.until("85 frames more", live_after(seq + 80))
                await other.until("its word", lambda v: (word(v) == "degraded") == degraded, 5.0)
                await asyncio.to_thread(mend)
                await other.until("it is back", live_after(other.frames[-1][1].seq))

            await through(lambda: setattr(line, "delay_s", 0.05), False, lambda: None)
            await through(lambda: setattr(line, "delay_s", 0.5), True, lambda: setattr(line, "delay_s", 0.0))
            await through(redis_server.freeze, True, redis_server.thaw)
            await through(redis_server.kill, True, redis_server.start)
            last = edge.seq - 1
            await viewer.until("all of them", lambda v: v.frames[-1][1].seq >= last)
        seqs = [seq for seq in clean(viewer) if first <= seq <= last]
        assert seqs == [*range(first, last + 1)]
        assert len(seqs) > 4 * 80
        assert all("degraded" not in said for said in viewer.told("status"))
        clean(other)
        found = await asyncio.to_thread(figures, port)
    assert found["posecast_store_losses_total"] >= 3
    assert found["posecast_store_up"] == 1
    assert found["posecast_store_seconds_bucket|0.5"] == found["posecast_store_seconds_count"] > 100
    assert found["posecast_store_seconds_bucket|0.1"] < found["posecast_store_seconds_count"]
