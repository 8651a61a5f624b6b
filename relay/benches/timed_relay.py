"""`posecast-relay` with a timer on its event loop: python -m relay.benches.timed_relay LAGFILE run …"""

from __future__ import annotations

import asyncio
import socket
import sys

import uvicorn
from posecast_relay.cli import main

from relay.benches.feed import watch_lag

_startup = uvicorn.Server.startup
_tasks: set[asyncio.Task[None]] = set()  # a task nobody holds may be collected


async def _startup_with_timer(self: uvicorn.Server, sockets: list[socket.socket] | None = None) -> None:
    _tasks.add(asyncio.create_task(watch_lag(LAG_FILE)))
    await _startup(self, sockets)


if __name__ == "__main__":
    LAG_FILE = sys.argv.pop(1)
    uvicorn.Server.startup = _startup_with_timer  # type: ignore[method-assign]
    sys.exit(main())
