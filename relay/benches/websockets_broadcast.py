"""Comparison: the `websockets` library's own `broadcast()`, on uvloop."""

from __future__ import annotations

import asyncio

import uvloop
from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.exceptions import ConnectionClosed

from relay.benches.feed import frames, listen, options, watch_lag
from relay.benches.stamps import Stamps

viewers: set[ServerConnection] = set()


async def live(connection: ServerConnection) -> None:
    viewers.add(connection)
    try:
        async for _message in connection:
            pass
    except ConnectionClosed:
        pass
    finally:
        viewers.discard(connection)


async def main() -> None:
    asked = options()
    async with serve(live, sock=listen(), backlog=4096, compression=None):
        lag = asyncio.create_task(watch_lag(asked.lag)) if asked.lag else None
        async for data in frames(asked.hz, asked.bytes, Stamps(asked.stamps)):
            broadcast(viewers, data)
        del lag


if __name__ == "__main__":
    uvloop.run(main())
