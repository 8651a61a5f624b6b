"""foxglove-sdk: its WebSocket server and one channel of raw bytes."""

from __future__ import annotations

import asyncio

import foxglove

from relay.benches.feed import frames, options
from relay.benches.stamps import Stamps


async def main() -> None:
    asked = options()
    server = foxglove.start_server(name="bench", host="127.0.0.1", port=0)
    channel = foxglove.Channel(
        "/frames", message_encoding="raw", schema=foxglove.Schema(name="raw", encoding="", data=b"")
    )
    print(f"PORT {server.port}", flush=True)
    async for data in frames(asked.hz, asked.bytes, Stamps(asked.stamps)):
        channel.log(data)


if __name__ == "__main__":
    asyncio.run(main())
