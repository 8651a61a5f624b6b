"""A distant network: passes bytes on with a varying delay. Replaces `netem`, which kernels may lack.

late_link.py HOST:PORT DELAY_MS WANDER_MS

Prints "PORT n", listens there on loopback, connects everybody to HOST:PORT. Each way takes DELAY ± WANDER.
"""

from __future__ import annotations

import asyncio
import random
import sys

CHUNK_BYTES = 65536
UNDER_WAY = 1000  # chunks; a sender that has so many on the way must wait


async def carry(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, delay_s: float, wander_s: float
) -> None:
    """One way, in order, until its end."""
    loop = asyncio.get_running_loop()
    under_way: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(UNDER_WAY)

    async def take() -> None:
        while chunk := await reader.read(CHUNK_BYTES):
            late_s = delay_s + random.uniform(-wander_s, wander_s)
            await under_way.put((loop.time() + late_s, chunk))
        await under_way.put((loop.time(), b""))

    taking = asyncio.create_task(take())
    try:
        while True:
            due_s, chunk = await under_way.get()
            await asyncio.sleep(max(0.0, due_s - loop.time()))
            if not chunk:
                return
            writer.write(chunk)
            await writer.drain()
    except OSError:
        return
    finally:
        taking.cancel()
        writer.close()


async def main(target: str, delay_s: float, wander_s: float) -> None:
    """Until killed."""
    host, _, port = target.rpartition(":")

    async def connect(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there, back = await asyncio.open_connection(host, int(port))
        await asyncio.gather(carry(reader, back, delay_s, wander_s), carry(there, writer, delay_s, wander_s))

    server = await asyncio.start_server(connect, "127.0.0.1", 0)
    print(f"PORT {server.sockets[0].getsockname()[1]}", flush=True)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], float(sys.argv[2]) / 1000, float(sys.argv[3]) / 1000))
