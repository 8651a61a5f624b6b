"""Sends a model's file as an HTTP answer: cacheable forever, compressed if that helps, and in pieces.

Each piece is copied from the cache just before it is sent. So a stalled answer holds only one piece, and the
cache can drop a file at any time. The answer is then aborted, and the client has to ask again.
"""

from __future__ import annotations

import asyncio
import gzip
from collections.abc import Callable, Mapping
from functools import partial
from http import HTTPStatus
from typing import cast

from fastapi import Request, Response
from starlette.types import Receive, Scope, Send

from posecast_relay.models.cache import ModelCache, ModelFile
from posecast_relay.models.memory import ModelMemory
from posecast_relay.net.answer_cache import has_already
from posecast_relay.net.http1 import AnswerAborted
from posecast_relay.net.request import OPEN, choose_encoding
from posecast_relay.runtime.tasks import SharedTasks

WORTH = 0.95  # a file that compresses worse is sent as it is
LEVEL = 6
AT_ONCE = 2  # files compressed in parallel; more have to wait


class GzipCache:
    """Compresses the content of a ModelMemory in a thread, and keeps the result there too.

    If no memory is left, answers are sent uncompressed.
    """

    def __init__(self, room: ModelMemory) -> None:
        self._room = room
        self._turn = asyncio.Semaphore(AT_ONCE)
        self._under_way = SharedTasks("pack")

    async def pack(self, robot: str, name: str) -> int:
        """Compress `name`, keep it as `make_packed_name(name)`, and return its size in bytes.

        Returns 0 if it does not get much smaller, or if no room is free. `robot`: whose memory it uses.
        """
        known = cast("bytes | None", self._room.get(make_packed_name(name)))
        if known is not None:
            return len(known)
        return await self._under_way.run(name, partial(self._pack, robot, name))

    async def _pack(self, robot: str, name: str) -> int:
        async with self._turn:
            plain = cast("bytes | bytearray | None", self._room.get(name))
            claim = self._room.claim(robot, len(plain), lambda: None) if plain is not None else None
            if plain is None or claim is None:
                return 0
            try:
                packed = await asyncio.to_thread(gzip.compress, plain, LEVEL, mtime=0)
                if len(packed) > WORTH * len(plain):
                    packed = b""  # remembers that compression does not help
                self._room.keep(claim, make_packed_name(name), packed, len(packed))
            finally:
                self._room.release(claim)
            return len(packed) if self._room.get(make_packed_name(name)) is not None else 0


def make_packed_name(name: str) -> str:
    """Return the name of the compressed form of `name`."""
    return f"{name}.gz"


PIECE_BYTES = 16 << 10
PIECES_PER_TURN = 16  # of the event loop
# A model comes from a robot and is not trusted: as a page in a browser it must not run or load anything.
MODEL_HEADERS = OPEN | {
    "cache-control": "public, max-age=31536000, immutable",
    "content-security-policy": "default-src 'none'; sandbox",
    "cross-origin-resource-policy": "cross-origin",  # pictures, in pages that are cross-origin isolated
    "x-content-type-options": "nosniff",
}
PACK_UP_TO_BYTES = (
    4_000_000  # the finest level of a mesh; compressing larger files would delay the first viewer
)


class PiecewiseResponse(Response):
    """An answer that sends a cached file piece by piece. `models`: the cache."""

    def __init__(
        self, models: ModelCache, name: str, size: int, type_: str, headers: Mapping[str, str]
    ) -> None:
        super().__init__(None, HTTPStatus.OK, {**headers, "content-length": str(size)}, type_)
        self._piece: Callable[[str, int, int], bytes | None] = models.copy_piece
        self._name = name
        self._size = size

    async def __call__(self, scope: Scope, _receive: Receive, send: Send) -> None:
        """Send the answer, as ASGI defines. Raises AnswerAborted if the file is no longer cached."""
        await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
        if scope["method"] == "HEAD" or not self._size:
            await send({"type": "http.response.body", "body": b""})
            return
        for number, off in enumerate(range(0, self._size, PIECE_BYTES)):
            piece = self._piece(self._name, off, PIECE_BYTES)
            if piece is None:
                raise AnswerAborted
            more = off + len(piece) < self._size
            await send({"type": "http.response.body", "body": piece, "more_body": more})
            if number % PIECES_PER_TURN == PIECES_PER_TURN - 1:
                await asyncio.sleep(0)


async def make_model_answer(
    request: Request, models: ModelCache, packed: GzipCache, robot: str, found: ModelFile
) -> Response:
    """Make the answer for a model's file; 304 if the client already has it."""
    name, type_, size = found
    headers = MODEL_HEADERS | {"etag": f'"{name}"', "vary": "accept-encoding"}
    if has_already(request, headers["etag"]):
        return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=headers)
    shrinks = size <= PACK_UP_TO_BYTES and not type_.startswith("image/")
    if shrinks and choose_encoding(request.headers, ("gzip",)) is not None:
        packed_size = await packed.pack(robot, name)
        if packed_size:
            headers |= {"content-encoding": "gzip", "etag": f'W/"{name}"'}
            name, size = make_packed_name(name), packed_size
    return PiecewiseResponse(models, name, size, type_, headers)
