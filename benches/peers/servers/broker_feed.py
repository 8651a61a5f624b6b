"""The robot of a broker (Mosquitto, NATS): publishes to topic `f` over its own protocol on TCP.

broker_feed.py mqtt|nats PORT --hz 30 --bytes 200 --stamps FILE

Prints "READY" when the broker has taken it in.
"""

from __future__ import annotations

import asyncio
import sys

from benches.peers.mqtt import TOPIC, connect, publish
from relay.benches.feed import frames, options
from relay.benches.stamps import Stamps


async def mqtt(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """CONNECT, and its answer."""
    writer.write(connect())
    await reader.readexactly(4)


async def nats(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """CONNECT, and a ping there and back."""
    await reader.readline()  # INFO
    writer.write(b'CONNECT {"verbose":false,"pedantic":false}\r\nPING\r\n')
    while b"PONG" not in await reader.readline():
        pass


async def pong(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Answers a NATS server that asks whether we are there."""
    while line := await reader.readline():
        if line.startswith(b"PING"):
            writer.write(b"PONG\r\n")


async def main() -> None:
    protocol, port = sys.argv.pop(1), int(sys.argv.pop(1))
    asked = options()
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    await (mqtt if protocol == "mqtt" else nats)(reader, writer)
    print("READY", flush=True)
    pongs = asyncio.create_task(pong(reader, writer)) if protocol == "nats" else None
    async for data in frames(asked.hz, asked.bytes, Stamps(asked.stamps)):
        packet = publish(data) if protocol == "mqtt" else b"PUB %b %d\r\n%b\r\n" % (TOPIC, len(data), data)
        writer.write(packet)
        await writer.drain()
    del pongs


if __name__ == "__main__":
    asyncio.run(main())
