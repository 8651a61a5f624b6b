"""Comparison: what most people write first, FastAPI and `await ws.send_bytes()` for each viewer in turn."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import uvicorn
from fastapi import FastAPI, WebSocket, WebSocketDisconnect

from relay.benches.feed import frames, listen, options, watch_lag
from relay.benches.stamps import Stamps

asked = options()
viewers: set[WebSocket] = set()


async def feed() -> None:
    async for data in frames(asked.hz, asked.bytes, Stamps(asked.stamps)):
        for ws in list(viewers):
            try:
                await ws.send_bytes(data)
            except (RuntimeError, WebSocketDisconnect):
                viewers.discard(ws)


@asynccontextmanager
async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
    tasks = [asyncio.create_task(feed())]
    if asked.lag:
        tasks.append(asyncio.create_task(watch_lag(asked.lag)))
    yield
    for task in tasks:
        task.cancel()


app = FastAPI(lifespan=lifespan)


@app.websocket("/live")
async def live(ws: WebSocket) -> None:
    await ws.accept()
    viewers.add(ws)
    try:
        while True:
            await ws.receive_text()
    except WebSocketDisconnect:
        pass
    finally:
        viewers.discard(ws)


if __name__ == "__main__":
    config = uvicorn.Config(app, loop="uvloop", log_level="error", backlog=4096)
    uvicorn.Server(config).run(sockets=[listen()])
