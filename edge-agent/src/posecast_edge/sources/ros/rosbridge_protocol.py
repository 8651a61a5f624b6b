"""The client's side of the rosbridge protocol v2: makes requests and parses what the server sends. Does no
I/O.

The only requests are `subscribe` and `call_service` for the queries of rosapi. Nothing is published.
"""

from __future__ import annotations

import json
import struct
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

MESSAGE_MAX = 16 << 20  # bytes of one message, put together
CBOR_MAX = 1 << 20  # bytes; an empty map takes one byte there, and seventy here. Descriptions use JSON
ITEMS_MAX = 250_000  # values in the lists and objects of one message; a robot description has none
ARRAY_MAX = 1 << 16  # numbers of a typed array
FRAGMENTS_MAX = 4096  # of one message
PARTS_MAX = 8  # messages being assembled at a time; beyond that, the oldest is dropped
PARTS_CHARS_MAX = MESSAGE_MAX  # of all of them
DIGITS_MAX = 500  # of an integer; a longer one is no reading
WORD_MAX = 300  # characters of a server's message, and of an id

# Tags that cbor2 decodes by default: dates, fractions, regular expressions, references. ROS messages use none
# of them, and some never end.
NO_TAGS = (0, 1, 2, 3, 4, 5, 25, 28, 29, 30, 35, 36, 37, 52, 54, 100, 256, 258, 260, 261, 1004, 43000, 55799)

# RFC 8746: tags of typed arrays, as rosbridge writes them → struct's letter; little-endian
TYPED_ARRAYS = {64: "B", 69: "H", 70: "I", 71: "Q", 72: "b", 77: "h", 78: "i", 79: "q", 85: "f", 86: "d"}


class RosbridgeProtocolError(ValueError):
    """The server sent something that is not rosbridge's protocol. One line."""


@dataclass(frozen=True)
class Publish:
    """A message on a topic, as mappings and lists."""

    topic: str
    message: Any


@dataclass(frozen=True)
class Answer:
    """A service's response to the call with this id. `values`: None when the call failed."""

    id: str
    values: dict[str, Any] | None


@dataclass(frozen=True)
class RosbridgeStatus:
    """A status message of the server about a request."""

    level: str
    text: str


Received = Publish | Answer | RosbridgeStatus


def make_subscribe(topic: str, type_name: str | None, encoding: str, throttle_ms: int) -> str:
    """The request to subscribe to a topic. `type_name`: in the server's spelling, None to let the server find
    it.

    With a throttle alone the server drops messages that come too soon, even the last one before a pause. A
    queue of length one makes it keep the newest and send it when the interval has passed.
    """
    wish: dict[str, object] = {"op": "subscribe", "id": f"posecast{topic}", "topic": topic}
    if type_name:
        wish["type"] = type_name
    if throttle_ms:
        wish |= {"throttle_rate": throttle_ms, "queue_length": 1}
    if encoding != "json":
        wish["compression"] = encoding
    return json.dumps(wish)


def make_service_call(service: str, call_id: str, **arguments: object) -> str:
    """The request to call a service of rosapi; all of them only report."""
    wish = {"op": "call_service", "id": call_id, "service": service, "args": arguments}
    return json.dumps(wish)


@dataclass
class _Parts:
    """Fragments of one message so far."""

    total: int
    found: dict[int, str] = field(default_factory=dict)
    size: int = 0


class MessageAssembler:
    """Assembles complete messages from what one connection receives."""

    def __init__(self) -> None:
        self._parts: OrderedDict[str, _Parts] = OrderedDict()
        self._chars = 0  # of all fragments kept

    def feed(self, data: str | bytes) -> Received | None:
        """Parse a WebSocket message: text as JSON, bytes as CBOR. None if it is of no interest or only a
        fragment.

        Raises RosbridgeProtocolError; earlier and later messages are not affected.
        """
        document = parse_json(data) if isinstance(data, str) else _cbor(data)
        if isinstance(document, dict) and document.get("op") == "fragment":
            whole = self._fragment(document)
            if whole is None:
                return None
            document = parse_json(whole)
        if not isinstance(document, dict) or not isinstance(document.get("op"), str):
            raise RosbridgeProtocolError("a message without op")
        return _parsed(document)

    def _fragment(self, document: dict[str, Any]) -> str | None:
        name, data, number, total = (document.get(key) for key in ("id", "data", "num", "total"))
        if (
            not isinstance(name, (str, int))
            or not isinstance(data, str)
            or not isinstance(number, int)
            or not isinstance(total, int)
            or not 0 < total <= FRAGMENTS_MAX
            or not 0 <= number < total
            or (len(name) > WORD_MAX if isinstance(name, str) else abs(name) >> 64)
        ):
            raise RosbridgeProtocolError("an invalid fragment")
        key = str(name)
        parts = self._parts.setdefault(key, _Parts(total))
        if parts.total != total or number in parts.found:
            # the rest never came, and the server has restarted its numbering
            self._give_up(key)
            parts = self._parts[key] = _Parts(total)
        parts.found[number] = data
        parts.size += len(data)
        self._chars += len(data)
        self._parts.move_to_end(key)
        if parts.size > MESSAGE_MAX:
            self._give_up(key)
            raise RosbridgeProtocolError(f"fragments of more than {MESSAGE_MAX >> 20} MiB")
        while len(self._parts) > PARTS_MAX or self._chars > PARTS_CHARS_MAX:
            self._give_up(next(iter(self._parts)))
        if len(parts.found) < total:
            return None
        self._give_up(key)
        return "".join(parts.found[i] for i in range(total))

    def _give_up(self, key: str) -> None:
        self._chars -= self._parts.pop(key).size


def _parsed(document: dict[str, Any]) -> Received | None:
    op = document["op"]
    if op == "publish":
        topic = document.get("topic")
        if not isinstance(topic, str):
            raise RosbridgeProtocolError("a message without a topic")
        return Publish(topic, document.get("msg"))
    if op == "service_response":
        values = document.get("values")
        good = document.get("result", True) is not False and isinstance(values, dict)
        return Answer(_word(document, "id"), values if good else None)
    if op == "status":
        return RosbridgeStatus(_word(document, "level"), _word(document, "msg"))
    if op == "png":
        raise RosbridgeProtocolError("PNG compression is not supported, and was not requested")
    return None


def _word(document: dict[str, Any], name: str) -> str:
    """A short text; "" for anything else, which may be huge."""
    value = document.get(name)
    return value[:WORD_MAX] if isinstance(value, str) else ""


def parse_json(text: str) -> Any:
    """Parse JSON as servers write it, with NaN and Infinity as null. Raises RosbridgeProtocolError."""
    if sum(text.count(sign) for sign in ",[{") > ITEMS_MAX:
        raise RosbridgeProtocolError(f"JSON of more than {ITEMS_MAX:,} values")
    try:
        return json.loads(text, parse_constant=_no_reading, parse_int=_read_integer)
    except RecursionError:
        raise RosbridgeProtocolError("JSON nested too deep") from None
    except ValueError as e:
        raise RosbridgeProtocolError(f"not JSON: {str(e)[:WORD_MAX]}") from None


def _no_reading(_token: str) -> None:
    """Replace NaN and Infinity, which some servers write although JSON lacks them."""


def _read_integer(digits: str) -> int | None:
    return int(digits) if len(digits) <= DIGITS_MAX else None  # Python refuses to read a longer one


def _cbor(data: bytes) -> Any:
    import cbor2  # noqa: PLC0415 - the extra [ros]; not needed for JSON

    if len(data) > CBOR_MAX:
        raise RosbridgeProtocolError(f"CBOR of {len(data)} bytes, at most {CBOR_MAX}")
    try:
        return cbor2.loads(
            data,
            tag_hook=_typed_array,
            semantic_decoders=dict.fromkeys(NO_TAGS, _no_value),
            strict_hashable_types=True,
        )
    except RosbridgeProtocolError:
        raise
    except Exception as e:  # the exceptions differ from version to version
        if isinstance(e.__cause__, RosbridgeProtocolError):
            raise e.__cause__ from None
        reason = " ".join(str(e).split())[:WORD_MAX]
        raise RosbridgeProtocolError(f"not CBOR: {type(e).__name__}: {reason}") from None


def _no_value(_value: Any, _immutable: bool) -> None:
    """Replace a tag that is not supported."""


def _typed_array(tag: Any, _immutable: bool) -> Any:
    letter = TYPED_ARRAYS.get(tag.tag)
    if letter is None or not isinstance(tag.value, bytes):
        return tag
    size = struct.calcsize(f"<{letter}")
    count, rest = divmod(len(tag.value), size)
    if rest:
        raise RosbridgeProtocolError(
            f"CBOR: a typed array of {len(tag.value)} bytes, {size} per number expected"
        )
    if count > ARRAY_MAX:
        raise RosbridgeProtocolError(f"CBOR: a typed array of {count} numbers, at most {ARRAY_MAX}")
    return list(struct.unpack(f"<{count}{letter}", tag.value))
