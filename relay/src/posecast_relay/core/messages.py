"""The core's messages: makes those for viewers, as complete WebSocket frames (unmasked, unfragmented,
uncompressed), and validates the JSON that an edge sends along with its frames: events, info and model.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping

from posecast_wire import WIRE_VERSION
from posecast_wire import HelloLimits as Granted
from posecast_wire.checked import is_number, loads
from posecast_wire.messages import TIME_MAX_S, Bye, Hello, Info, Model, Pong, RateGranted, RobotStatus, Status

from posecast_relay.core.limits import Limits

PING = b"\x89\x00"  # a whole WebSocket ping without payload


def pack_message(opcode: int, payload: bytes) -> bytes:
    """Return one WebSocket message as bytes; `opcode` as in RFC 6455."""
    first, size = 0x80 | opcode, len(payload)
    if size < 126:
        return bytes((first, size)) + payload
    if size < 1 << 16:
        return bytes((first, 126)) + size.to_bytes(2, "big") + payload
    return bytes((first, 127)) + size.to_bytes(8, "big") + payload


def split_messages(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the opcode and payload of each message in bytes that `pack_message` made."""
    at = 0
    while at < len(data):
        opcode, size, at = data[at] & 0x0F, data[at + 1], at + 2
        if size >= 126:
            width = 2 if size == 126 else 8
            size, at = int.from_bytes(data[at : at + width], "big"), at + width
        yield opcode, data[at : at + size]
        at += size


def make_binary(payload: bytes) -> bytes:
    """Return a binary message as bytes (RFC 6455 §5.2). Made once per frame, for all viewers."""
    return pack_message(2, payload)


def make_text(payload: str) -> bytes:
    """Return a text message as bytes."""
    return pack_message(1, payload.encode())


def make_json(doc: Mapping[str, object]) -> bytes:
    """Return a JSON document as a text message."""
    return make_text(json.dumps(doc, separators=(",", ":"), ensure_ascii=False))


def make_hello(
    unix_s: float,
    robot: str,
    view: str,
    hz: float,
    model: str | None,
    limits: Limits,
    max_hz: float | None = None,
    delay_s: float = 0.0,
) -> bytes:
    """Make `hello`, the first message of every connection.

    `max_hz`: this viewer's limit, if it has one.
    """
    granted: Granted = {
        "max_hz": limits.max_hz if max_hz is None else max_hz,
        "message_bytes": limits.message_bytes,
    }
    if delay_s > 0:
        granted["delay_s"] = delay_s
    if limits.max_age_s != float("inf"):
        granted["max_age_s"] = limits.max_age_s
    doc: Hello = {
        "type": "hello",
        "wire": WIRE_VERSION,
        "server_time": round(unix_s, 3),
        "robot": robot,
        "view": view,
        "hz": hz,
        "limits": granted,
        "model": model,
    }
    return make_json(doc)


def make_status(
    robot_status: RobotStatus,
    age_ms: int | None,
    seq: int | None,
    now: float,
    degraded: bool = False,
    over_share: bool = False,
) -> bytes:
    """Make `status`: the robot's status and the age of its newest frame at `now`.

    `degraded`: this relay can't hear the robot now. `over_share`: the robot exceeds its share, so some of its
    frames are dropped.
    """
    doc: Status = {
        "type": "status",
        "robot": robot_status,
        "age_ms": age_ms,
        "seq": seq,
        "clock_ms": to_clock_ms(now),
    }
    if degraded:
        doc["degraded"] = True
    if over_share:
        doc["over_share"] = True
    return make_json(doc)


def make_info(kv: dict[str, str]) -> bytes:
    """Make `info`: the robot's texts by name."""
    doc: Info = {"type": "info", "kv": kv}
    return make_json(doc)


def make_model(digest: str) -> bytes:
    """Make `model`: the SHA-256 of the robot's model."""
    doc: Model = {"type": "model", "hash": digest}
    return make_json(doc)


def make_rate(hz: float, reason: str) -> bytes:
    """Make `rate`: the rate in Hz at which a viewer is served from now on, and why."""
    doc: RateGranted = {"type": "rate", "hz": hz, "reason": reason}
    return make_json(doc)


def make_pong(t: float, now: float) -> bytes:
    """Make `pong`, the answer at `now` to a viewer's ping."""
    return make_json(describe_pong(t, now))


def describe_pong(t: float, now: float) -> Pong:
    """Return `pong` as a JSON document."""
    return {"type": "pong", "t": t, "clock_ms": to_clock_ms(now)}


def to_clock_ms(now: float) -> int:
    """Return the core's clock as viewers get it, by which they tell how late a stream arrives."""
    return int(1000 * now)


def make_bye(code: int, reason: str, retry_s: float | None, lane: str | None = None) -> bytes:
    """Make `bye`: why the connection ends, how many seconds to wait before a retry, and where to read on
    meanwhile.

    `lane`: an address relative to that of the stream.
    """
    doc: Bye = {"type": "bye", "code": code, "reason": reason, "retry_s": retry_s}
    if lane is not None:
        doc["lane"] = lane
    return make_json(doc)


SHA256 = re.compile("[0-9a-f]{64}")
LEVELS = ("fault", "caution", "info")
STATES = ("on", "off")


def read_edge_message(payload: bytes, limits: Limits) -> dict[str, object] | None:
    """Parse an event, info or model (chosen by `type`) and keep the members that viewers know.

    Returns None if the message is invalid. The result can always be written as JSON in UTF-8.
    """
    if len(payload) > max(limits.event_bytes, limits.info_bytes):
        return None
    try:
        doc = loads(payload)
    except ValueError:
        return None
    kind = doc.get("type") if isinstance(doc, dict) else None
    members = MEMBERS.get(kind) if isinstance(kind, str) else None
    if (
        not isinstance(doc, dict)
        or members is None
        or (kind == "event" and len(payload) > limits.event_bytes)
    ):
        return None
    if not all(is_sound(doc.get(name)) for name, is_sound in members.items()):
        return None
    return {"type": kind} | {name: doc[name] for name in members}


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_texts(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(text, str) for text in value.values())


MEMBERS: dict[str, dict[str, Callable[[object], bool]]] = {
    "event": {
        "t": lambda value: is_number(value, -TIME_MAX_S, TIME_MAX_S),
        "level": lambda value: value in LEVELS,
        "source": _is_text,
        "text": _is_text,
        "state": lambda value: value in STATES,
    },
    "info": {"kv": _is_texts},
    "model": {"hash": lambda value: isinstance(value, str) and SHA256.fullmatch(value) is not None},
}


def make_conflict_event(t_s: float, present: bool) -> dict[str, object]:
    """Make the relay's own event for a second edge that claims this robot, or no longer does.

    `t_s`: seconds of the robot's clock.
    """
    t_s = max(-TIME_MAX_S, min(t_s, TIME_MAX_S))
    return {
        "type": "event",
        "t": t_s,
        "level": "caution",
        "source": "relay",
        "text": "another edge claims this robot",
        "state": "on" if present else "off",
    }
