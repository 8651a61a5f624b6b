"""Reads models from robots' agents over Zenoh."""

from __future__ import annotations

import asyncio
import contextlib

import zenoh
from posecast_wire.keys import model_key

from posecast_relay.core.hub import Hub
from posecast_relay.models.cache import RANGE_BYTES, Refused, Unavailable
from posecast_relay.models.manifest import BYTES_MAX
from posecast_relay.zenoh.router import RouterSession

RANGE_TIMEOUT_S = 10.0


class EdgeModels:
    """A ModelSource that asks robots' agents for models that they announce now."""

    def __init__(self, router: RouterSession, hub: Hub) -> None:
        self._router = router
        self._hub = hub

    def offers(self, robot: str, digest: str) -> bool:
        """Return whether the robot announces this model now."""
        of = self._hub.robots.get(robot)
        return of is not None and any(room.stream.model == digest for room in of.rooms.values())

    async def fetch_manifest(self, robot: str, digest: str) -> bytes:  # noqa: ARG002 — an agent has only one
        """Return the agent's present manifest, which may differ from `digest`. Raises Unavailable."""
        data, key = bytearray(), model_key(robot, "manifest")
        while len(data) % RANGE_BYTES == 0:  # an agent sends at most this much at once
            piece = await self._get(f"{key}?off={len(data)};len={RANGE_BYTES}", RANGE_BYTES)
            data += piece
            if len(data) > BYTES_MAX:
                raise Refused(f"the robot's manifest has more than {BYTES_MAX} bytes")
            if not piece:
                break
        return bytes(data)

    async def read(self, robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:  # noqa: ARG002
        """Return up to `size` bytes of a file from `off`. Raises Unavailable."""
        return await self._get(f"{model_key(robot, sha256)}?off={off};len={size}", size)

    async def _get(self, selector: str, most: int) -> bytes:
        """Return the first reply to a query.

        Raises Unavailable if none arrives, Refused if it has more than `most` bytes.
        """
        loop = asyncio.get_running_loop()
        ended: asyncio.Future[None] = loop.create_future()
        replies: list[bytes | None] = []  # one reply at most

        def on_reply(reply: zenoh.Reply) -> None:  # in a Zenoh thread
            if reply.ok is not None and not replies and not ended.done():
                payload = reply.ok.payload
                replies.append(payload.to_bytes() if len(payload) <= most else None)

        def end() -> None:
            if not ended.done():
                ended.set_result(None)

        def on_end() -> None:
            with contextlib.suppress(RuntimeError):  # the loop has closed: the relay is stopping
                loop.call_soon_threadsafe(end)

        try:
            self._router.session.get(
                selector,
                zenoh.handlers.Callback(on_reply, on_end),
                timeout=RANGE_TIMEOUT_S,
                priority=zenoh.Priority.DATA_LOW,
            )
            async with asyncio.timeout(RANGE_TIMEOUT_S + 1):  # wait_for may swallow a cancellation
                await ended
        except (zenoh.ZError, TimeoutError) as e:
            raise Unavailable(f"the robot's agent does not answer: {e or 'timeout'}") from None
        finally:
            ended.cancel()
        if not replies:
            raise Unavailable("the robot's agent does not answer")
        reply = replies.pop()  # Zenoh keeps the callback for a while; don't keep the bytes with it
        if reply is None:
            raise Refused(f"the robot's agent answered more than {most} bytes")
        return reply
