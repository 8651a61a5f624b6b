"""What the comparison servers share: payload, rate, the loop's lateness, the listening socket."""

from __future__ import annotations

import argparse
import asyncio
import socket
import struct
import time
from collections.abc import AsyncIterator

from relay.benches.stamps import Stamps

KEY_HEADER = struct.Struct("<BIId")  # wire format 1: tag, schema id, seq, t s
LAG_EVERY_S = 0.01
LAG_SAMPLE = struct.Struct("<dd")  # monotonic s, lateness s


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("--hz", type=float, required=True)
    parser.add_argument("--bytes", type=int, default=200)
    parser.add_argument("--stamps", required=True)
    parser.add_argument("--lag", help="file for the event loop's lateness")
    return parser.parse_args()


def payload(seq: int, size: int) -> bytes:
    """A KEY's header, so that the viewers find the seq, and filler."""
    return KEY_HEADER.pack(0x13, 0, seq, time.monotonic()).ljust(size, b"\x5a")


async def frames(hz: float, size: int, stamps: Stamps) -> AsyncIterator[bytes]:
    """One payload per tick. A tick that comes late is made at once and the schedule starts anew from it."""
    seq, due = 0, time.monotonic()
    while True:
        await asyncio.sleep(max(0.0, due - time.monotonic()))
        due = max(due + stamps.period_s(hz), time.monotonic())
        seq += 1
        stamps.note(seq)
        yield payload(seq, size)


async def watch_lag(path: str) -> None:
    """How late a 10 ms timer fires, for as long as the loop runs; one record per firing."""
    with open(path, "wb", buffering=0) as file:
        while True:
            began = time.monotonic()
            await asyncio.sleep(LAG_EVERY_S)
            now = time.monotonic()
            file.write(LAG_SAMPLE.pack(now, now - began - LAG_EVERY_S))


def listen() -> socket.socket:
    """A free loopback port with room for a storm, announced as the bench expects."""
    listener = socket.create_server(("127.0.0.1", 0), backlog=4096)
    print(f"PORT {listener.getsockname()[1]}", flush=True)
    return listener
