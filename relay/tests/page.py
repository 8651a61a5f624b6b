"""A page that watches a robot: what it says and shows at each moment.

The rules are those of `spa/src/twin/liveness.ts`, written once more.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Any, NamedTuple

from posecast_wire import Close, Decoder, Frame, FrameError

from .sim import split

STALE_S = 1.5
QUIET_S = 2.0


class Shown(NamedTuple):
    """What a screen said and showed at a moment. `pose_at`: when that pose was made; None: there is none."""

    at: float
    word: str
    pose_at: float | None


class Page:
    """An outlet that reads everything at once, and answers as the page does."""

    descriptor = -1

    def __init__(self, loop: asyncio.AbstractEventLoop, robot: str, delay_s: float = 0.0) -> None:
        self.loop = loop
        self.robot = robot
        self.delay_s = delay_s  # all it is shown happened so long ago
        self.ended: str | None = None
        self.told: list[dict[str, Any]] = []
        self.poses: list[tuple[int, int]] = []  # run and seq of what was shown, one after the other
        self.shown: list[Shown] = []
        self.undecodable = 0
        self.say: Callable[[dict[str, Any] | None], None] = lambda _doc: None  # None: a pong
        self._received = 0
        self._acked_at = float("-inf")
        self._decoder = Decoder()
        self._status: dict[str, Any] | None = None
        self._status_at = 0.0
        self._fresh_at: float | None = None
        self._heard_at = loop.time()
        self._pose: Frame | None = None

    def write(self, data: bytes) -> None:
        """Outlet: one write is read at once, and then looked at."""
        now = self._heard_at = self.loop.time()
        frames = []
        for opcode, payload in split(data):
            if opcode == 1:
                self._text(json.loads(payload), payload, now)
            elif opcode == 2:
                self._received += 1
                try:
                    frames.append(self._decoder.decode(payload))
                except FrameError:
                    self.undecodable += 1
                    continue
                seq = self._status["seq"] if self._status else None
                if seq is not None and frames[-1].seq > seq:
                    self._fresh_at = now
            else:
                self.loop.call_soon(self.say, None)
        if frames:
            self._pose = frames[-1]
            self.poses.append((self._pose.codes[0], self._pose.seq))
        if self._received and now - self._acked_at >= 1.0:
            self._acked_at = now
            self.loop.call_soon(self.say, {"type": "ack", "n": self._received})
        self.look()

    def _text(self, doc: dict[str, Any], payload: bytes, now: float) -> None:
        if doc["type"] == "status":
            self._status, self._status_at = doc, now
        elif doc["type"] == "schema":
            self._decoder.add_schema(payload.decode())
        if doc["type"] != "schema":
            self.told.append(doc)

    def end(self, close: Close, reason: str, retry_s: float | None, lane: str | None = None) -> None:
        """Outlet."""
        self.ended = f"{close.name}: {reason}"

    def cut(self, close: Close) -> None:
        """Outlet."""
        self.ended = close.name

    def look(self) -> Shown:
        """Now."""
        now = self.loop.time()
        self.shown.append(Shown(now, self._word(now), self._pose.t_s if self._pose else None))
        return self.shown[-1]

    def _word(self, now: float) -> str:
        status = self._status
        if self.ended is not None or status is None or now - self._heard_at >= QUIET_S:
            return "STALE no connection"
        if status.get("degraded"):
            return "STALE relay degraded"
        if status["robot"] == "offline":
            return "OFFLINE"
        spoke = self._fresh_at is not None and self._fresh_at > self._status_at
        if status["robot"] == "silent" and not spoke:
            return "STALE robot silent"
        ages = [] if status["age_ms"] is None else [status["age_ms"] / 1000 + now - self._status_at]
        ages += [] if self._fresh_at is None else [now - self._fresh_at]
        if not ages or min(ages) >= STALE_S or now - self._heard_at >= STALE_S:
            return "STALE robot silent"
        return "LIVE" if self._pose else "the first pose is on its way"
