"""A page without a browser: watches a robot and says the word that the page would say, as lines of JSON.

    screen.py ws://127.0.0.1:8080/api/v1/robots/demo/live?hz=10 [VIEWERS]

{"viewer", "at", "word", "cause"} when the word changes, and likewise "seq", "t", "schema", "behind_s" for
every frame, "closed" with the close code when a connection ends, "undecodable" for a frame that is none.
`at` is the machine's monotonic clock; `behind_s` is a frame's age beyond that of the least delayed one.
The rules are those of DESIGN ("Viewer's truth") and wire/SPEC.md, written a second time on purpose.
"""

from __future__ import annotations

import asyncio
import json
import random
import sys
import time
from contextlib import suppress
from contextvars import ContextVar
from typing import Any

import websockets
from posecast_wire.closes import Close, Retry, retry_of
from posecast_wire.decoder import Decoder
from posecast_wire.frame import FrameError

STALE_S = 1.5
QUIET_S = 2.0
HOLDING_S = 3.0
JOINING_S = 3.0
SILENT_S = 3.0  # a socket that says nothing for so long is dead, whatever the kernel thinks
ACK_S = 1.0
LOOK_S = 0.01


VIEWER: ContextVar[int] = ContextVar("viewer")


def say(**what: Any) -> None:
    print(json.dumps({"viewer": VIEWER.get(), "at": time.monotonic(), **what}), flush=True)


class Screen:
    """What one viewer knows."""

    def __init__(self) -> None:
        self.opened_s = time.monotonic()
        self.connected = False
        self.ever_connected = False
        self.heard_s: float | None = None
        self.status: dict[str, Any] | None = None
        self.status_s = 0.0
        self.fresh_s: float | None = None
        self.changed_s: float | None = None
        self.retry_s: float | None = None  # what the relay asked for in its bye
        self._codes: tuple[int, ...] = ()
        self._seq = -1
        self._schema = 0
        self._least_s = float("inf")
        self._said: tuple[str | None, str | None] = ("", None)

    def judge(self, now_s: float) -> tuple[str | None, str | None]:
        """The word and its cause."""
        link_s = now_s - self.heard_s if self.heard_s is not None else float("inf")
        if not self.connected or self.status is None or link_s >= QUIET_S:
            joining = not self.ever_connected and now_s - self.opened_s <= JOINING_S
            return (None, None) if joining and self.status is None else ("STALE", "no connection")
        if self.status.get("degraded"):
            return "STALE", "relay degraded"
        if self.status["robot"] == "offline":
            return "OFFLINE", None
        spoke = self.fresh_s is not None and self.fresh_s > self.status_s
        if self.status["robot"] == "silent" and not spoke:
            return "STALE", "robot silent"
        if link_s >= STALE_S:
            return "STALE", "no connection"
        age_s = (
            None if self.status["age_ms"] is None else self.status["age_ms"] / 1000 + now_s - self.status_s
        )
        if self.fresh_s is not None:
            age_s = min(now_s - self.fresh_s, age_s if age_s is not None else float("inf"))
        if age_s is None or age_s >= STALE_S:
            return "STALE", "robot silent"
        holding = self.changed_s is not None and now_s - self.changed_s >= HOLDING_S
        return ("HOLDING" if holding else "LIVE"), None

    def look(self) -> None:
        """Says the word if it is another one."""
        found = self.judge(time.monotonic())
        if found != self._said:
            self._said = found
            say(word=found[0], cause=found[1])

    def text(self, message: dict[str, Any]) -> None:
        """One JSON message."""
        self.heard_s = time.monotonic()
        if message["type"] == "status":
            self.status, self.status_s = message, self.heard_s
        elif message["type"] == "bye":
            self.retry_s = message["retry_s"]

    def frame(self, decoder: Decoder, payload: bytes) -> None:
        """One binary message."""
        now_s = self.heard_s = time.monotonic()
        try:
            frame = decoder.decode(payload)
        except FrameError as e:
            say(undecodable=str(e))
            return
        if frame.schema.id != self._schema or frame.seq < self._seq:
            self._schema, self._least_s = frame.schema.id, float("inf")
        known = self.status["seq"] if self.status and self.status["seq"] is not None else -1
        if frame.seq > known or frame.seq < self._seq:
            self.fresh_s = now_s
        self._seq = frame.seq
        if tuple(frame.codes) != self._codes:
            self._codes, self.changed_s = tuple(frame.codes), now_s
        self._least_s = min(self._least_s, now_s - frame.t_s)
        behind_s = round(now_s - frame.t_s - self._least_s, 3)
        say(seq=frame.seq, t=frame.t_s, schema=frame.schema.id, behind_s=behind_s)


async def connection(screen: Screen, url: str) -> int | None:
    """From open to close; the close code, None for a cut."""
    decoder, received, acknowledged, acknowledged_s = Decoder(), 0, 0, time.monotonic()
    async with websockets.connect(
        url, proxy=None, compression=None, ping_interval=None, close_timeout=1
    ) as link:
        screen.connected = screen.ever_connected = True
        while True:
            try:
                message = await asyncio.wait_for(link.recv(), SILENT_S)
            except TimeoutError:
                link.transport.abort()
                return None
            except websockets.ConnectionClosed as e:
                return code_of(e)
            if isinstance(message, bytes):
                received += 1
                screen.frame(decoder, message)
            else:
                document = json.loads(message)
                screen.text(document)
                if document["type"] == "schema":
                    decoder.add_schema(message)
            now_s = time.monotonic()
            if now_s - acknowledged_s >= ACK_S and received > acknowledged:
                acknowledged, acknowledged_s = received, now_s
                try:
                    await link.send(json.dumps({"type": "ack", "n": received}))
                except websockets.ConnectionClosed as e:  # its end came while this was made
                    return code_of(e)


def code_of(end: websockets.ConnectionClosed) -> int | None:
    """What the relay said."""
    return end.rcvd.code if end.rcvd else None


async def watch(url: str, viewer: int) -> None:
    """Comes back by the retry rules of the close table."""
    VIEWER.set(viewer)
    screen, failures = Screen(), 0

    async def looking() -> None:
        while True:
            screen.look()
            await asyncio.sleep(LOOK_S)

    looks = asyncio.create_task(looking())
    while not looks.done():
        code, began_s, screen.retry_s = None, time.monotonic(), None
        with suppress(OSError, TimeoutError, websockets.WebSocketException):
            code = await connection(screen, url)
        failures = failures + 1 if not screen.connected else 0
        screen.connected = False
        say(closed=code, lived_s=round(time.monotonic() - began_s, 3))
        await asyncio.sleep(delay_s(code, failures, screen.retry_s))


def delay_s(code: int | None, failures: int, retry_s: float | None) -> float:
    """Until the next try."""
    backoff: float = random.random() * min(30.0, 0.5 * 2**failures)
    rule = retry_of(Close(code)) if code in set(Close) else Retry.BACKOFF
    if rule is Retry.SPREAD and failures == 0:
        return random.random() * (retry_s if retry_s is not None else 10.0)
    return (retry_s or 30.0) + backoff if rule is Retry.WAIT else backoff


async def main(url: str, viewers: int) -> None:
    """Until killed."""
    await asyncio.gather(*(watch(url, viewer) for viewer in range(viewers)))


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 1))
