"""`posecast-relay` with a timer on its event loop, or where io_uring is forbidden:
python -m relay.benches.odd_relay [--lag FILE] [--no-uring] run …"""

from __future__ import annotations

import argparse
import asyncio
import socket
import sys

import uvicorn
from posecast_relay.cli import main
from posecast_relay.runtime.fan_out import IoUring

from relay.benches.feed import watch_lag

_startup = uvicorn.Server.startup
_tasks: set[asyncio.Task[None]] = set()  # a task nobody holds may be collected


async def _startup_with_timer(self: uvicorn.Server, sockets: list[socket.socket] | None = None) -> None:
    _tasks.add(asyncio.create_task(watch_lag(asked.lag)))
    await _startup(self, sockets)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--lag")
    parser.add_argument("--no-uring", action="store_true")
    asked, sys.argv[1:] = parser.parse_known_args()
    if asked.lag:
        uvicorn.Server.startup = _startup_with_timer  # type: ignore[method-assign]
    if asked.no_uring:
        IoUring.open = classmethod(lambda _: None)  # type: ignore[assignment]
    main()
