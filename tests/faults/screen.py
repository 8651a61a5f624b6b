"""A page without a browser: watches a robot and prints the state word that the page would show, as lines of
JSON.

screen.py ws://127.0.0.1:8080/api/v1/robots/demo/live?hz=10 [VIEWERS]

{"viewer", "at", "word", "cause"} when the word changes, and likewise "seq", "t", "schema", "behind_s", "pose"
for every frame that is shown, "closed" with the close code when a connection ends, "undecodable" for an
invalid frame. `at` is the machine's monotonic clock; `behind_s` is a frame's age compared with the least
delayed one; `pose` the first two positions; `held_up_s` how long the machine had blocked this process before.
The rules of the page (twin/liveness.ts, stream/) and of wire/SPEC.md, written a second time on purpose.
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
from posecast_wire.decoder import Decoder, Frame
from posecast_wire.frame import FrameError

STALE_S = 1.5
QUIET_S = 2.0
HOLDING_S = 3.0
GAP_S = 2.5  # after a longer pause, it is unknown whether the pose moved meanwhile
JOINING_S = 3.0
SILENT_S = 3.0  # a socket that is silent for this long is dead, whatever the kernel thinks
ACK_S = 1.0
LOOK_S = 0.01
HELD_UP_S = 0.25  # between two checks
BASE = 0x02  # bit of a frame's first byte: later frames may build on this one


VIEWER: ContextVar[int] = ContextVar("viewer")


class Screen:
    """The knowledge of one viewer."""

    def __init__(self) -> None:
        self.opened_s = time.monotonic()
        self.connected = False
        self.cut = False  # the connection was lost, and there is no other yet
        self.moves = False  # its relay is being replaced, and the old one's data is not old yet
        self.moved = False  # no frame has arrived from the relay that it was moved to
        self.heard_s: float | None = None
        self.status: dict[str, Any] | None = None
        self.status_s = 0.0
        self.fresh_s: float | None = None
        self.changed_s: float | None = None
        self.shown_s: float | None = None  # when the pose that is shown was the robot's newest, for sure
        self.left_s: float | None = None  # when the newest frame left the relay, at the earliest
        self.silent_since_s: float | None = None  # data may have been in transit since then
        self.retry_s: float | None = None  # what the relay asked for in its bye
        self._alive_s = time.monotonic()
        self._codes: tuple[int, ...] = ()
        self._seq = -1
        self._t_s = 0.0
        self._schema = 0
        self._least_s = float("inf")
        self._said: tuple[str | None, str | None] = ("", None)

    def judge(self, now_s: float) -> tuple[str | None, str | None]:
        """The word and its cause."""
        link_s = now_s - self.heard_s if self.heard_s is not None else float("inf")
        if not self.connected or self.status is None or link_s >= QUIET_S:
            joining = not self.cut and now_s - self.opened_s <= JOINING_S
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
        age_s = self.find_age_s(now_s)
        if age_s is None or age_s >= STALE_S:
            return "STALE", "robot silent"
        if self.shown_s is None:
            return None, None  # the first pose is in transit
        if now_s - self.shown_s >= STALE_S:
            return "STALE", "relay degraded"  # the robot is fine, but not what is shown
        holding = self.changed_s is not None and now_s - self.changed_s >= HOLDING_S
        return ("HOLDING" if holding else "LIVE"), None

    def find_age_s(self, now_s: float) -> float | None:
        """The age of the robot's newest pose; None when none is known."""
        told = self.status["age_ms"] if self.status else None
        age_s = None if told is None else told / 1000 + now_s - self.status_s
        if self.fresh_s is not None:
            age_s = min(now_s - self.fresh_s, age_s if age_s is not None else float("inf"))
        return age_s

    def say(self, now_s: float, **what: Any) -> None:
        """One line."""
        held_up_s = now_s - self._alive_s
        self._alive_s = now_s
        if held_up_s > HELD_UP_S:
            what["held_up_s"] = held_up_s
        print(json.dumps({"viewer": VIEWER.get(), "at": now_s, **what}), flush=True)

    def look(self, now_s: float) -> None:
        """Prints the word if it has changed."""
        found = self.judge(now_s)
        if found != self._said:
            self._said = found
            self.say(now_s, word=found[0], cause=found[1])
        elif now_s - self._alive_s > HELD_UP_S:
            self.say(now_s)
        self._alive_s = now_s

    def opened(self, now_s: float) -> None:
        """A new connection: old knowledge about the robot may not hold for it."""
        moved = self.moves and self.heard_s is not None and now_s - self.heard_s < STALE_S
        self.connected, self.cut, self.heard_s = True, False, now_s
        self.moved = moved
        if moved:
            return
        self.moves = False
        self.status = self.fresh_s = self.changed_s = None
        self.shown_s = self.left_s = self.silent_since_s = None
        self.look(now_s)

    def lost(self, now_s: float, code: int | None, lived_s: float) -> None:
        """The connection is lost."""
        is_recent = self.heard_s is not None and now_s - self.heard_s < STALE_S
        self.moves = is_recent and (code == Close.DRAIN or (self.moves and code is None))
        if not self.moves:
            self.cut = self.cut or self.connected
            self.connected = False
        self.say(now_s, closed=code, lived_s=round(lived_s, 3))
        self.look(now_s)

    def hears(self, now_s: float) -> bool:
        """Something arrives. True if the relay must be asked how much of it is old, after a silence."""
        silent = self.heard_s is not None and now_s - self.heard_s >= STALE_S and self.silent_since_s is None
        if silent:
            self.silent_since_s = self.heard_s
        self.heard_s = self._left_s(now_s)
        return silent

    def _left_s(self, now_s: float) -> float:
        """The earliest time at which the data arriving now left the relay."""
        return now_s if self.silent_since_s is None else self.silent_since_s

    def text(self, message: dict[str, Any], now_s: float) -> None:
        """One JSON message."""
        if message["type"] == "status":
            says_nothing = message.get("degraded") or message["robot"] == "offline" or message["seq"] is None
            age_s = self.find_age_s(now_s)
            if self.moves and says_nothing and age_s is not None and age_s < STALE_S:
                return  # it does not know the robot yet
            self.moves = False
            self.status, self.status_s = message, self._left_s(now_s)
            if self.left_s is not None and message["seq"] == self._seq and message["age_ms"] is not None:
                # a frame that is here has a stricter bound: it is at least as old as its time here
                message["age_ms"] = max(message["age_ms"], 1000 * (self.status_s - self.left_s))
            self._vouch()
        elif message["type"] == "pong":
            self.silent_since_s = None  # all that was on its way before the question is here
        elif message["type"] == "bye":
            self.retry_s = message["retry_s"]
        self.look(now_s)

    def _vouch(self) -> None:
        """What the newest status says about the shown frame."""
        if self.left_s is None or self.status is None or self.status["age_ms"] is None:
            return
        if self.status["seq"] == self._seq:
            born_s = self.status_s - self.status["age_ms"] / 1000
            self.shown_s = max(born_s, self.shown_s if self.shown_s is not None else born_s)

    def _was_passed(self, frame: Frame) -> bool:
        """Whether it is the frame that is shown, or one of the same run before it."""
        lag_s = self._t_s - frame.t_s
        return (frame.seq, lag_s) == (self._seq, 0.0) or (frame.seq < self._seq and 0.0 < lag_s < STALE_S)

    def frame(self, decoder: Decoder, payload: bytes, now_s: float) -> None:
        """One binary message."""
        try:
            frame = decoder.decode(payload)
        except FrameError as e:
            self.say(now_s, undecodable=str(e))
            return
        if self.moved and self._was_passed(frame):
            return  # the old relay had already sent it, or a newer one
        self.moved = False
        known = self.status["seq"] if self.status else None
        if payload[0] & BASE and known is not None and frame.seq < known:
            return  # a base of the newest frame, not the robot's current state
        if frame.schema.id != self._schema or frame.seq < self._seq:
            self._schema, self._least_s = frame.schema.id, float("inf")
        left_s = self._left_s(now_s)
        if known is not None and frame.seq > known:
            self.fresh_s = self.shown_s = left_s
        unsure = self.left_s is None or left_s - self.left_s > GAP_S
        self.left_s = left_s
        if unsure or tuple(frame.codes) != self._codes:
            self._codes, self.changed_s = tuple(frame.codes), now_s
        self._seq, self._t_s = frame.seq, frame.t_s
        self._vouch()
        self._least_s = min(self._least_s, now_s - frame.t_s)
        behind_s = round(now_s - frame.t_s - self._least_s, 3)
        pose = frame.values("pos")[:2]
        told = {"seq": frame.seq, "t": frame.t_s, "schema": frame.schema.id}
        self.say(now_s, **told, behind_s=behind_s, pose=pose)
        self.look(now_s)


async def connection(screen: Screen, url: str) -> int | None:
    """From open to close; the close code, None for a cut."""
    decoder, received, acknowledged, acknowledged_s = Decoder(), 0, 0, time.monotonic()
    async with websockets.connect(
        url, proxy=None, compression=None, ping_interval=None, close_timeout=1
    ) as link:
        screen.opened(time.monotonic())
        while True:
            try:
                message = await asyncio.wait_for(link.recv(), SILENT_S)
            except TimeoutError:
                link.transport.abort()
                return None
            except websockets.ConnectionClosed as e:
                return code_of(e)
            now_s = time.monotonic()
            says = [{"type": "ping", "t": now_s}] if screen.hears(now_s) else []
            if isinstance(message, bytes):
                received += 1
                screen.frame(decoder, message, now_s)
            else:
                document = json.loads(message)
                if document["type"] == "schema":
                    decoder.add_schema(message)
                screen.text(document, now_s)
            if now_s - acknowledged_s >= ACK_S and received > acknowledged:
                acknowledged, acknowledged_s = received, now_s
                says.append({"type": "ack", "n": received})
            try:
                for one in says:
                    await link.send(json.dumps(one))
            except websockets.ConnectionClosed as e:  # its end came while this was made
                return code_of(e)


def code_of(end: websockets.ConnectionClosed) -> int | None:
    """What the relay said."""
    return end.rcvd.code if end.rcvd else None


async def watch(url: str, viewer: int) -> None:
    """Reconnects by the retry rules of the close table."""
    VIEWER.set(viewer)
    screen, failures = Screen(), 0

    async def looking() -> None:
        while True:
            screen.look(time.monotonic())
            await asyncio.sleep(LOOK_S)

    looks = asyncio.create_task(looking())
    while not looks.done():
        code, began_s, screen.retry_s = None, time.monotonic(), None
        with suppress(OSError, TimeoutError, websockets.WebSocketException):
            code = await connection(screen, url)
        failures = failures + 1 if not screen.connected else 0
        screen.lost(time.monotonic(), code, time.monotonic() - began_s)
        await asyncio.sleep(delay_s(code, failures, screen.retry_s))


def delay_s(code: int | None, failures: int, retry_s: float | None) -> float:
    """Until the next try."""
    backoff: float = random.random() * min(30.0, 0.5 * 2**failures)
    rule = retry_of(Close(code)) if code in set(Close) else Retry.BACKOFF
    if rule is Retry.SPREAD and failures == 0:
        return random.random() * (retry_s if retry_s is not None else 10.0)
    if rule is Retry.LATER:
        return random.uniform(30.0, 60.0)
    return (retry_s or 30.0) + backoff if rule is Retry.WAIT else backoff


async def main(url: str, viewers: int) -> None:
    """Until killed."""
    await asyncio.gather(*(watch(url, viewer) for viewer in range(viewers)))


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 1))
