"""What goes out to viewers, as ready WebSocket messages (unmasked, unfragmented, uncompressed)."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping

from posecast_wire import WIRE_VERSION
from posecast_wire import Limits as Granted
from posecast_wire.messages import Bye, Hello, Info, Model, Pong, RateGranted, RobotStatus, Status

from posecast_relay.core.limits import Limits

PING = b"\x89\x00"  # a whole WebSocket ping without payload


def pack_message(opcode: int, payload: bytes) -> bytes:
    """One message as bytes for the socket; `opcode` as in RFC 6455."""
    first, size = 0x80 | opcode, len(payload)
    if size < 126:
        return bytes((first, size)) + payload
    if size < 1 << 16:
        return bytes((first, 126)) + size.to_bytes(2, "big") + payload
    return bytes((first, 127)) + size.to_bytes(8, "big") + payload


def split_messages(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and payload of each message in what was packed here."""
    at = 0
    while at < len(data):
        opcode, size, at = data[at] & 0x0F, data[at + 1], at + 2
        if size >= 126:
            width = 2 if size == 126 else 8
            size, at = int.from_bytes(data[at : at + width], "big"), at + width
        yield opcode, data[at : at + size]
        at += size


def make_binary(payload: bytes) -> bytes:
    """A binary message as bytes for the socket: done once per frame, whoever gets it (RFC 6455 §5.2)."""
    return pack_message(2, payload)


def make_text(payload: str) -> bytes:
    """A text message as bytes for the socket."""
    return pack_message(1, payload.encode())


def make_json(doc: Mapping[str, object]) -> bytes:
    """A JSON message as bytes for the socket."""
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
    """First message of every connection. `max_hz`: of this viewer, where it is less than of any."""
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
    degraded: bool = False,
    over_share: bool = False,
) -> bytes:
    """How the robot is, and how old its newest frame. `degraded`: this relay does not hear of robots now.

    `over_share`: the robot sends more than its share, so some of its frames are dropped.
    """
    doc: Status = {"type": "status", "robot": robot_status, "age_ms": age_ms, "seq": seq}
    if degraded:
        doc["degraded"] = True
    if over_share:
        doc["over_share"] = True
    return make_json(doc)


def make_info(kv: dict[str, str]) -> bytes:
    """The robot's slow strings."""
    doc: Info = {"type": "info", "kv": kv}
    return make_json(doc)


def make_model(digest: str) -> bytes:
    """The robot's model changed."""
    doc: Model = {"type": "model", "hash": digest}
    return make_json(doc)


def make_rate(hz: float, reason: str) -> bytes:
    """This viewer's rate is now `hz`."""
    doc: RateGranted = {"type": "rate", "hz": hz, "reason": reason}
    return make_json(doc)


def make_pong(t: float) -> bytes:
    """Answer to a viewer's ping."""
    doc: Pong = {"type": "pong", "t": t}
    return make_json(doc)


def make_bye(code: int, reason: str, retry_s: float | None) -> bytes:
    """Why the connection ends now."""
    doc: Bye = {"type": "bye", "code": code, "reason": reason, "retry_s": retry_s}
    return make_json(doc)
