"""The rosbridge protocol v2, a client's side: what is said, what what comes means. Pure, without I/O.

Only these are ever said: `subscribe`, and `call_service` of rosapi's questions. Nothing is published.
"""

from __future__ import annotations

import json
import struct
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

MESSAGE_MAX = 16 << 20  # bytes of one message, put together
FRAGMENTS_MAX = 4096  # of one message
PARTS_MAX = 8  # messages that are put together at a time; the oldest is given up

# RFC 8746: tags of typed arrays, as rosbridge writes them → struct's letter; little-endian
TYPED_ARRAYS = {64: "B", 69: "H", 70: "I", 71: "Q", 72: "b", 77: "h", 78: "i", 79: "q", 85: "f", 86: "d"}


class ProtocolError(ValueError):
    """What came is not rosbridge's. One line."""


@dataclass(frozen=True)
class Publish:
    """A message of a topic, as mappings and lists."""

    topic: str
    message: Any


@dataclass(frozen=True)
class Answer:
    """A service's answer to the call of that id. `values`: None when the call failed."""

    id: str
    values: dict[str, Any] | None


@dataclass(frozen=True)
class Status:
    """A word of the server's about what was asked."""

    level: str
    text: str


Heard = Publish | Answer | Status


def subscribe(topic: str, type_name: str | None, encoding: str, throttle_ms: int) -> str:
    """Ask for a topic. `type_name` as the server spells it; None: the server looks.

    A throttle alone drops what comes too soon, also the last value before a pause. With a queue of one the
    server keeps the newest and sends it when its time has come.
    """
    wish: dict[str, object] = {"op": "subscribe", "id": f"posecast{topic}", "topic": topic}
    if type_name:
        wish["type"] = type_name
    if throttle_ms:
        wish |= {"throttle_rate": throttle_ms, "queue_length": 1}
    if encoding != "json":
        wish["compression"] = encoding
    return json.dumps(wish)


def ask(service: str, call_id: str, **arguments: object) -> str:
    """Call a service that only tells."""
    wish = {"op": "call_service", "id": call_id, "service": service, "args": arguments}
    return json.dumps(wish)


@dataclass
class _Parts:
    """Fragments of one message so far."""

    total: int
    found: dict[int, str] = field(default_factory=dict)
    size: int = 0


class Ear:
    """Takes what one connection brings."""

    def __init__(self) -> None:
        self._parts: OrderedDict[str, _Parts] = OrderedDict()

    def feed(self, data: str | bytes) -> Heard | None:
        """A whole WebSocket message: text is JSON, bytes CBOR. None when it is of no interest, or its rest
        has yet to come. ProtocolError; what came before and comes after is good all the same."""
        document = _json(data) if isinstance(data, str) else _cbor(data)
        if isinstance(document, dict) and document.get("op") == "fragment":
            whole = self._fragment(document)
            if whole is None:
                return None
            document = _json(whole)
        if not isinstance(document, dict) or not isinstance(document.get("op"), str):
            raise ProtocolError("a message without op")
        return _heard(document)

    def _fragment(self, document: dict[str, Any]) -> str | None:
        name, data, number, total = (document.get(key) for key in ("id", "data", "num", "total"))
        if (
            not isinstance(name, (str, int))
            or not isinstance(data, str)
            or not isinstance(number, int)
            or not isinstance(total, int)
            or not 0 < total <= FRAGMENTS_MAX
            or not 0 <= number < total
        ):
            raise ProtocolError("a fragment that is none")
        key = str(name)
        parts = self._parts.setdefault(key, _Parts(total))
        if parts.total != total or number in parts.found:
            # its rest never came, and the server counts anew
            parts = self._parts[key] = _Parts(total)
        parts.found[number] = data
        parts.size += len(data)
        self._parts.move_to_end(key)
        while len(self._parts) > PARTS_MAX:
            self._parts.popitem(last=False)
        if parts.size > MESSAGE_MAX:
            del self._parts[key]
            raise ProtocolError(f"fragments of more than {MESSAGE_MAX >> 20} MiB")
        if len(parts.found) < total:
            return None
        del self._parts[key]
        return "".join(parts.found[i] for i in range(total))


def _heard(document: dict[str, Any]) -> Heard | None:
    op = document["op"]
    if op == "publish":
        topic = document.get("topic")
        if not isinstance(topic, str):
            raise ProtocolError("a message without a topic")
        return Publish(topic, document.get("msg"))
    if op == "service_response":
        values = document.get("values")
        good = document.get("result", True) is not False and isinstance(values, dict)
        return Answer(str(document.get("id")), values if good else None)
    if op == "status":
        return Status(str(document.get("level", "")), str(document.get("msg", "")))
    if op == "png":
        raise ProtocolError("PNG compression is not read, and was not asked for")
    return None


def _json(text: str) -> Any:
    try:
        return json.loads(text, parse_constant=_no_reading)
    except RecursionError:
        raise ProtocolError("JSON nested too deep") from None
    except ValueError as e:
        raise ProtocolError(f"not JSON: {e}") from None


def _no_reading(_token: str) -> None:
    """NaN and Infinity, which some servers write though JSON has none."""


def _cbor(data: bytes) -> Any:
    import cbor2  # noqa: PLC0415 - the extra [ros]; JSON does without

    try:
        return cbor2.loads(data, tag_hook=_typed_array)
    except (cbor2.CBORDecodeError, RecursionError, struct.error) as e:
        raise ProtocolError(f"not CBOR: {type(e).__name__}: {e}") from None


def _typed_array(tag: Any, _immutable: bool) -> Any:
    letter = TYPED_ARRAYS.get(tag.tag)
    if letter is None or not isinstance(tag.value, bytes):
        return tag
    count, rest = divmod(len(tag.value), struct.calcsize(f"<{letter}"))
    if rest:
        raise ProtocolError(f"a typed array of {len(tag.value)} bytes")
    return list(struct.unpack(f"<{count}{letter}", tag.value))
