"""The lane for tests: followers over HTTP, and a counter of the requests that reach a relay."""

from __future__ import annotations

import asyncio
import json
import ssl
from contextlib import suppress
from dataclasses import dataclass, field
from typing import NamedTuple

ROBOT = "/api/v1/robots/demo"


class Answer(NamedTuple):
    """Of an HTTP server."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def is_segment(self) -> bool:
        """Whether these are a segment's bytes."""
        return self.status == 200 and self.headers["content-type"] == "application/octet-stream"


class Link:
    """One HTTP connection that is kept open. Raises OSError or EOFError when it is cut."""

    def __init__(self, port: int, trust: ssl.SSLContext | None = None) -> None:
        self._port, self._trust = port, trust
        self._open: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def ask(self, path: str, **headers: str) -> Answer:
        """GET."""
        await self.send(path, **headers)
        return await self.receive()

    async def send(self, path: str, **headers: str) -> None:
        """Send a request without waiting for the answer."""
        lines = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
        await self.write(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n{lines}\r\n".encode())

    async def write(self, data: bytes) -> None:
        """Send these bytes, whatever they are."""
        if self._open is None:
            at = ("127.0.0.1", self._port)
            name = None if self._trust is None else "localhost"
            self._open = await asyncio.open_connection(*at, ssl=self._trust, server_hostname=name)
        self._open[1].write(data)

    async def read_until_closed(self) -> bytes:
        """Everything that the other end sends until it closes or resets the connection."""
        assert self._open is not None
        got = b""
        with suppress(ConnectionError, ssl.SSLError):
            while data := await self._open[0].read(65536):
                got += data
        return got

    async def receive(self) -> Answer:
        """The answer to what was sent."""
        assert self._open is not None
        return (await read_answer(self._open[0]))[1]

    def cut(self) -> None:
        """Disconnect at once, whatever is in transit."""
        if self._open is not None:
            self._open[1].transport.abort()
            self._open = None


async def read_answer(reader: asyncio.StreamReader) -> tuple[bytes, Answer]:
    """The next one, as it came and read. Raises EOFError."""
    head = await reader.readuntil(b"\r\n\r\n")
    first, *lines = head.decode().split("\r\n")[:-2]
    headers = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    if headers.get("transfer-encoding") == "chunked":
        body, sent = b"", head
        while True:
            size = await reader.readuntil(b"\r\n")
            chunk = await reader.readexactly(int(size, 16) + 2)
            body, sent = body + chunk[:-2], sent + size + chunk
            if len(chunk) == 2:
                return sent, Answer(int(first.split()[1]), headers, body)
    body = await reader.readexactly(int(headers.get("content-length", 0)))
    return head + body, Answer(int(first.split()[1]), headers, body)


@dataclass
class Follower:
    """Reads segment after segment, the next one as soon as one has arrived. `got`: take and index of each."""

    link: Link
    got: list[tuple[str, int]] = field(default_factory=list)
    refused: list[Answer] = field(default_factory=list)

    async def follow(self) -> None:
        """Until cancelled."""
        newest = None
        while newest is None:
            newest = json.loads((await self.link.ask(f"{ROBOT}/past?view=public")).body)["newest"]
        take, index = newest["take"], newest["index"]
        while True:
            answer = await self.link.ask(f"{ROBOT}/past/public/{take}/{index}")
            if answer.is_segment:
                self.got.append((take, index))
                index += 1
            elif answer.status == 200:
                following = json.loads(answer.body)["next"]
                take, index = following["take"], following["index"]
            else:
                if answer.status != 204:
                    self.refused.append(answer)
                await asyncio.sleep(1)


@dataclass
class Origin:
    """Sits in front of a relay and counts the requests. `refuses`: it hangs up instead of answering."""

    address: str
    refuses: bool = False
    asked: list[str] = field(default_factory=list)
    answered: list[tuple[str, Answer]] = field(default_factory=list)
    heads: list[bytes] = field(default_factory=list)

    async def start(self) -> int:
        """Listen; the port."""
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        return int(self._server.sockets[0].getsockname()[1])

    def stop(self) -> None:
        """No longer listen."""
        self._server.close()

    def list_segments(self) -> list[str]:
        """The addresses of the segments it served, each as often as served."""
        return [path for path, answer in self.answered if answer.is_segment]

    def count(self, status: int) -> int:
        """How many of its answers had this status."""
        return sum(answer.status == status for _, answer in self.answered)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        host, _, port = self.address.rpartition(":")
        relay_reader, relay_writer = await asyncio.open_connection(host, int(port))
        with suppress(OSError, EOFError, asyncio.CancelledError):
            while True:
                request = await reader.readuntil(b"\r\n\r\n")
                path = request.split(b" ")[1].decode()
                self.asked.append(path)
                self.heads.append(request.lower())
                if self.refuses:
                    break
                relay_writer.write(request)
                raw, answer = await read_answer(relay_reader)
                self.answered.append((path, answer))
                writer.write(raw)
                await writer.drain()
        relay_writer.close()
        writer.close()
