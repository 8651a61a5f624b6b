"""A relay's routes of the past in this process, over segments that a test keeps and a clock that it sets."""

from __future__ import annotations

import asyncio
import hashlib
import json
import time
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import httpx
import uvicorn
from posecast_relay.auth.access import open_access
from posecast_relay.auth.tokens import Tokens
from posecast_relay.core.delayed import DelayedHub
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import Audience, Policy, Principal, Rule, list_lookers, make_link
from posecast_relay.http.app import make_app
from posecast_relay.models.cache import ModelCache
from posecast_relay.net.encodings import DecodeCache
from posecast_relay.net.sse import make_http_protocol
from posecast_relay.net.websocket import make_live_protocol
from posecast_relay.past.memory import MemoryPast, MemoryPastSource
from posecast_relay.past.segment import KeptSegment, PastEvent, PastWord, SegmentName
from posecast_relay.past.service import PastService
from posecast_relay.past.source import PastSource
from posecast_relay.runtime.dispatcher import MemoryStore
from posecast_relay.runtime.fan_out import FanOut
from posecast_relay.zenoh.models import EdgeModels
from posecast_testing import until_async
from posecast_wire.segment import EventRecord, FrameRecord, Segment, SegmentStart, encode_segment

from .sim import Edge, schema

KEY = "k" * 43
PAGE_MS = 1_795_000_800_000  # 2026-11-18T11:20Z
PAGE = "2026-11-18T11:20Z"
DAY = "2026-11-18"
TAKE = 0xA
SCHEMA = schema()
SCHEMA_HASH = hashlib.sha256(SCHEMA.text.encode()).digest()
Rules = Mapping[str, Mapping[Audience, Rule]]


class Accounts:
    """Whoever says `somebody` is."""

    def verify(self, token: str) -> Principal | None:
        """As Firebase does."""
        return Principal(Audience.SIGNED_IN, token=token) if token == "somebody" else None


def link(robot: str, key: str = KEY) -> str:
    """A share link's token. Some are made when tests are collected, and good for the longest run."""
    return make_link(key, robot, int(time.time()) + 100_000, "abcdefgh")


def make_kept(
    index: int, from_ms: int, *, robot: str = "r", view: str = "public", take: int = TAKE, **more: Any
) -> KeptSegment:
    """A segment of four seconds with one frame and one event, for anyone unless said otherwise."""
    edge = Edge(0xE, SCHEMA)
    edge.seq = 10 * index - 1
    event = json.dumps({"type": "event", "text": f"event {index}", "n": index + 1, "at": from_ms / 1000})
    frame = FrameRecord(1000, 0, 10 * index, edge.frame(1.0, force_key=True))
    start = SegmentStart(robot, view, take, index, 0xE, from_ms, SCHEMA_HASH.hex())
    data = encode_segment(Segment(start, from_ms + 4000, (frame, EventRecord(2000, event))))
    kept: dict[str, Any] = {
        "name": SegmentName(robot, view, take, index),
        "run": 0xE,
        "from_ms": from_ms,
        "to_ms": from_ms + 4000,
        "frames": 1,
        "first_seq": 10 * index,
        "last_seq": 10 * index,
        "missing": 9 if index else 0,
        "schema": SCHEMA_HASH,
        "model": None,
        "data": data,
        "sha256": hashlib.sha256(data).digest(),
        "events": (PastEvent(from_ms + 2, event),),
        "words": (PastWord(from_ms, "online"),),
        "faults": 1,
        "audiences": frozenset(Audience),
        "schema_text": SCHEMA.text,
    }
    return KeptSegment(**kept | more)


class PastDoors:
    """The routes over a MemoryPast, or another source. `unix_ms` and `now` are what the routes take for the
    time.
    """

    def __init__(
        self,
        rules: Rules | None,
        source: PastSource | None = None,
        models: ModelCache | None = None,
        has_models: bool = False,
    ) -> None:
        limits = Limits(sweep_s=0.1)
        self.tokens = Tokens(Accounts(), {"r": KEY, "open": KEY})
        self.access = open_access(
            *(Hub(limits), DelayedHub(limits), MemoryStore(), FanOut(None)),
            policy=Policy(rules),
            tokens=self.tokens,
        )
        for dispatcher in self.access.dispatchers:
            dispatcher.carry_out(dispatcher.hub.set_token("r", True, dispatcher.now()))
        self.past = MemoryPast(1 << 26)
        self.source = source or MemoryPastSource(self.past)
        self.unix_ms, self.now = PAGE_MS, 0.0
        self.models = models
        self.service = PastService(
            self.source, lambda: self.now, lambda: self.unix_ms / 1000, has_models=has_models
        )
        self.client = httpx.AsyncClient(trust_env=False, timeout=20)

    def allow(self, rules: Rules) -> None:
        """Another file of robots; no answer of before is shown again."""
        self.access.set_policy(Policy(rules))
        self.now += 2

    def keep(self, index: int, from_ms: int | None = None, **more: Any) -> KeptSegment:
        """Keep a segment, as a recorder would by the rules in force. Its end is now."""
        at_ms = self.unix_ms - 4000 if from_ms is None else from_ms
        name = more.get("robot", "r"), more.get("view", "public")
        more.setdefault("audiences", list_lookers(self.access.policy, *name))
        segment = make_kept(index, at_ms, **more)
        self.past.add(segment, 0.0)
        self.now += 2
        return segment

    async def start(self) -> None:
        """Serve on a free port."""
        decoded, none = DecodeCache(), SimpleNamespace()
        edges = EdgeModels(none, self.access.live.hub)  # type: ignore[arg-type]
        models = self.models or ModelCache(edges, 1)
        self.app = make_app(self.access, models, decoded, None, past=self.service)
        self.server = uvicorn.Server(
            uvicorn.Config(
                self.app,
                port=0,
                ws=make_live_protocol(self.access, decoded),
                http=make_http_protocol(self.access, decoded),
                lifespan="off",
                log_config=None,
            )
        )
        self._task = asyncio.create_task(self.server.serve())
        while not self.server.started:
            await asyncio.sleep(0.01)
        self.port = self.server.servers[0].sockets[0].getsockname()[1]
        self.base = f"http://127.0.0.1:{self.port}/api/v1/robots"

    async def __aenter__(self) -> PastDoors:
        """Serve until the end of the block."""
        await self.start()
        return self

    async def __aexit__(self, *_: object) -> None:
        """End it."""
        await self.stop()

    async def stop(self) -> None:
        """End it."""
        self.service.held.release()
        await self.client.aclose()
        self.server.should_exit = True
        await self._task

    async def ask(self, path: str, token: str | None = None, method: str = "GET", **headers: str) -> Any:
        """A request below the robot `r`'s past, or of the robot that the path begins with."""
        sent = {name.replace("_", "-"): value for name, value in headers.items()}
        if token is not None:
            sent["authorization"] = f"Bearer {token}"
        below = "/" if path and not path.startswith("?") else ""
        address = self.base + (path if path.startswith("/") else f"/r/past{below}{path}")
        return await self.client.request(method, address, headers=sent)

    async def ask_ready(self) -> Any:
        """What /readyz says."""
        return await self.client.get(f"http://127.0.0.1:{self.port}/readyz")

    async def until_held(self, count: int) -> None:
        """Wait until so many requests are held."""
        await until_async(f"{count} requests are held", lambda: self.service.held.count == count)


def address_of(segment: KeptSegment) -> str:
    """Where a segment is."""
    return f"{segment.name.view}/{segment.name.take:016x}/{segment.name.index}"
