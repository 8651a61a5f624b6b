"""The JSON messages of the stream (SPEC "Messages")."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, TypedDict

from posecast_wire.checked import is_number, loads
from posecast_wire.closes import Close

MESSAGE_BYTES_MAX = 4096  # of one viewer's message
COUNT_MAX = (1 << 53) - 1  # the largest exact integer in a browser
HZ_MIN = 0.1  # the lowest rate that still shows a robot move
HZ_MAX = 1000
TIME_MAX_S = 1e12  # of any clock, either way: 31,700 years, and milliseconds still fit a double

RobotStatus = Literal["online", "silent", "offline"]


class HelloLimits(TypedDict, total=False):
    """What this viewer is allowed, as far as the relay limits it. `delay_s`: everything it receives is
    delayed by this."""

    max_hz: float
    max_age_s: float
    delay_s: float
    message_bytes: int


class Hello(TypedDict):
    """The first message of every connection. `server_time`: Unix time, seconds; `hz`: the granted rate."""

    type: Literal["hello"]
    wire: int
    server_time: float
    robot: str
    view: str
    hz: float
    limits: HelloLimits
    model: str | None


class _StatusBase(TypedDict):
    type: Literal["status"]
    robot: RobotStatus
    age_ms: int | None
    seq: int | None


class Status(_StatusBase, total=False):
    """Sent after hello and then at least once a second. `age_ms`, `seq`: of the newest frame; None before the
    first.

    `degraded`: the relay itself can't receive from robots now (a gateway without Redis). `over_share`: the
    robot sends more than the relay accepts from it, so some of its frames are dropped. `clock_ms`: the
    relay's clock at that moment, which never steps; only differences are meaningful.
    """

    degraded: bool
    over_share: bool
    clock_ms: int


class Info(TypedDict):
    """Texts about the robot that change rarely; each message contains all of them."""

    type: Literal["info"]
    kv: dict[str, str]


class _EventBase(TypedDict):
    type: Literal["event"]
    t: float
    level: Literal["fault", "caution", "info"]
    source: str
    text: str
    state: Literal["on", "off"]


class Event(_EventBase, total=False):
    """A condition that began or ended. `t`: robot clock, seconds. The relay adds a number `n` and `at` (Unix
    time, s)."""

    n: int
    at: float


class RateGranted(TypedDict):
    """The relay changed this viewer's rate."""

    type: Literal["rate"]
    hz: float
    reason: str


class Model(TypedDict):
    """The robot's model changed: SHA-256 of its manifest, hexadecimal."""

    type: Literal["model"]
    hash: str


class _PongBase(TypedDict):
    type: Literal["pong"]
    t: float


class Pong(_PongBase, total=False):
    """The reply to a ping, with its `t`. `clock_ms`: the relay's clock, as in `Status`."""

    clock_ms: int


class _ByeBase(TypedDict):
    type: Literal["bye"]
    code: int
    reason: str
    retry_s: float | None


class Bye(_ByeBase, total=False):
    """Why the relay closes the connection. `retry_s`: see the retry rule of `code`; None if the relay
    suggests nothing.

    `lane`: where this viewer may read on without a connection, as segments by HTTP; an address that is
    resolved against that of the stream.
    """

    lane: str


class DecodedFrame(TypedDict):
    """A frame for `format=json`: values per field in its unit, None where there is no reading."""

    type: Literal["frame"]
    seq: int
    t: float
    values: dict[str, list[float | None]]


RelayMessage = Hello | Status | Info | Event | RateGranted | Model | Pong | Bye | DecodedFrame


@dataclass(frozen=True)
class Rate:
    """The viewer asks for `hz` frames a second: 0, for status and events only, or 0.1 … 1000."""

    hz: float


@dataclass(frozen=True)
class Ack:
    """The viewer has received `n` binary messages on this connection."""

    n: int


@dataclass(frozen=True)
class Auth:
    """A token, sent as the first message."""

    token: str


@dataclass(frozen=True)
class Ping:
    """A ping; `t` is returned in the pong."""

    t: float


ViewerMessage = Rate | Ack | Auth | Ping

_ACK = re.compile(rb'\{"type":"ack","n":(0|[1-9][0-9]{0,14})\}')  # the form that our page writes


class MessageError(ValueError):
    """A viewer's message that ends the connection, with the close code that gives the reason."""

    def __init__(self, close: Close, reason: str) -> None:
        super().__init__(reason)
        self.close = close


def parse_viewer_message(text: str | bytes) -> ViewerMessage:
    """Parse a viewer's message. Raises MessageError: 1007 if it is not UTF-8, 1009 above 4 KiB, 1008 if it is
    none of the four messages."""
    if isinstance(text, bytes) and (found := _ACK.fullmatch(text)) is not None:
        return Ack(int(found[1]))  # nearly every message is an ack, so skip the full parser
    doc = _document(text)
    kind = doc.get("type")
    if kind == "rate":
        return Rate(clamp_hz(_number(doc, "hz", 0, HZ_MAX)))
    if kind == "ack":
        n = _number(doc, "n", 0, COUNT_MAX)
        if n != int(n):
            raise MessageError(Close.NOT_ALLOWED, "n must be a whole number")
        return Ack(int(n))
    if kind == "ping":
        return Ping(_number(doc, "t", -COUNT_MAX, COUNT_MAX))
    if kind == "auth":
        token = doc.get("token")
        if not isinstance(token, str) or not token:
            raise MessageError(Close.NOT_ALLOWED, "token must be a text")
        return Auth(token)
    raise MessageError(Close.NOT_ALLOWED, "type must be rate, ack, auth or ping")


def clamp_hz(hz: float) -> float:
    """Raise a requested rate below 0.1 Hz to 0.1 Hz; 0 stays 0 (SPEC §6)."""
    return max(hz, HZ_MIN) if hz > 0 else 0


def _document(text: str | bytes) -> dict[str, object]:
    if len(text) > MESSAGE_BYTES_MAX:
        raise MessageError(Close.TOO_LONG, f"over {MESSAGE_BYTES_MAX} bytes")
    try:
        raw = text if isinstance(text, bytes) else text.encode()
        if len(raw) > MESSAGE_BYTES_MAX:
            raise MessageError(Close.TOO_LONG, f"over {MESSAGE_BYTES_MAX} bytes")
        doc = loads(raw)
    except UnicodeError:
        raise MessageError(Close.NOT_UTF8, "not UTF-8") from None
    except MessageError:
        raise
    except ValueError:
        raise MessageError(Close.NOT_ALLOWED, "not JSON") from None
    if not isinstance(doc, dict):
        raise MessageError(Close.NOT_ALLOWED, "not an object")
    return doc


def _number(doc: dict[str, object], name: str, low: float, high: float) -> float:
    value = doc.get(name)
    if not is_number(value, low, high):
        raise MessageError(Close.NOT_ALLOWED, f"{name} must be a number from {low:g} to {high:g}")
    return value
