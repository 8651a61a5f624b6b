"""Encodes the data that relays exchange through Redis: messages on a robot's channel, and a stream's hash.
Makes the messages about a robot for other processes: updates of a stream, its whole state, and presence.
Does no I/O.

Data from Redis is not trusted: malformed data raises ValueError with a message of one line.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from posecast_wire import Snapshot, check_name
from posecast_wire.checked import loads

from posecast_relay.core.replica import Presence, StreamState, StreamUpdate
from posecast_relay.core.robot import Robot
from posecast_relay.core.stream import StoredFrame, Stream
from posecast_relay.past.segment import SHA256, WHOLE_MAX

UPDATE, STANDING = b"U", b"S"
HEADER_END = b"\n"

BYTES_MAX = 1 << 21  # of one message: a hundred events of 4 kB and two frames take a third of it
FRAMES_MAX = 2  # a KEY and the newest
EVENTS_MAX = 100
EVENT_BYTES_MAX = 1 << 14  # an edge's 2 kB may take four times as many when they are written anew
VIEWS_MAX = 64
NAME_MAX = 64  # characters of a version or numbering
SCHEMA_BYTES_MAX = 1 << 18
INFO_BYTES_MAX = 1 << 17
FRAME_BYTES_MAX = 1 << 16
SECONDS_MAX = 1e10  # three centuries; also a clock's
HEX = re.compile("[0-9a-f]{1,16}")


def pack(message: StreamUpdate | Presence) -> bytes:
    """Encode a message for a robot's channel: a line of JSON, followed by the frames of an update."""
    if isinstance(message, Presence):
        return STANDING + dump(
            {
                "token": message.token,
                "ages": {
                    view: None if age is None else round(age, 3) for view, age in message.ages_s.items()
                },
                "newest": {view: [f"{run_id:016x}", seq] for view, (run_id, seq) in message.newest.items()},
                "sent": _rounded(message.sent_s),
            }
        )
    head = {
        "view": message.view,
        "generation": message.generation,
        "run": f"{message.run_id:016x}",
        "version": message.version,
        "numbering": message.numbering,
        "late": round(message.late_s, 4),
        "frames": [(ns, len(frame)) for ns, frame in message.frames],
        "events": message.events,
        "sent": _rounded(message.sent_s),
    }
    return UPDATE + dump(head) + HEADER_END + b"".join(frame for _, frame in message.frames)


def unpack(data: bytes) -> StreamUpdate | Presence:
    """Decode a message from a robot's channel. Raises ValueError if it is invalid."""
    if len(data) > BYTES_MAX:
        raise ValueError("relayed message: too long")
    if data[:1] == STANDING:
        return _standing(_object(data[1:], "standing"))
    if data[:1] == UPDATE:
        head, _, rest = data[1:].partition(HEADER_END)
        return _update(_object(head, "update"), rest)
    raise ValueError("relayed message: of an unknown kind")


def unpack_state(fields: Mapping[bytes, bytes]) -> StreamState:
    """Decode the hash of a stream. Raises ValueError if it is invalid."""
    model = _bytes(fields, b"model", 64).decode() or None
    if model is not None and not SHA256.fullmatch(model):
        raise ValueError("state: model is none")
    info = _object(_bytes(fields, b"info", INFO_BYTES_MAX), "info")
    if not all(isinstance(text, str) for text in info.values()):
        raise ValueError("state: info is none")
    dump(info)  # what cannot be told is refused here
    events = _bytes(fields, b"events", EVENTS_MAX * EVENT_BYTES_MAX)
    return StreamState(
        generation=_digits(fields, b"generation"),
        run_id=_run(_bytes(fields, b"run", 16).decode()),
        stamp_ns=_digits(fields, b"stamp"),
        version=_name(_bytes(fields, b"version", NAME_MAX).decode()),
        numbering=_name(_bytes(fields, b"numbering", NAME_MAX).decode()),
        snapshot=Snapshot(
            _bytes(fields, b"schema", SCHEMA_BYTES_MAX).decode(),
            info,
            _bytes(fields, b"key", FRAME_BYTES_MAX),
            model,
        ),
        newest=_bytes(fields, b"frame", FRAME_BYTES_MAX),
        events=unpack_events(events),
        is_heard=fields.get(b"heard") != b"0",
    )


def unpack_events(data: bytes) -> tuple[str, ...]:
    """Decode the numbered events of a stream. Raises ValueError if they are invalid."""
    return tuple(_event(doc) for doc in _list(_loads(data), EVENTS_MAX))


def dump(doc: object) -> bytes:
    """Encode as JSON. Raises ValueError for values that JSON can't have: 1e999, an unpaired surrogate."""
    try:
        return json.dumps(doc, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
    except RecursionError:
        raise ValueError("relayed message: nested too deeply") from None


def _standing(doc: dict[str, Any]) -> Presence:
    ages_s = {_view(view): None if age is None else _seconds(age) for view, age in _views(doc, "ages")}
    newest = {}
    for view, named in _views(doc, "newest"):
        run, seq = _list(named, 2, 2)
        newest[_view(view)] = _run(run), _whole(seq)
    if not isinstance(doc.get("token"), bool):
        raise ValueError("relayed message: token is none")
    return Presence(doc["token"], ages_s, newest, _sent(doc))


def _update(doc: dict[str, Any], rest: bytes) -> StreamUpdate:
    frames, at = [], 0
    for named in _list(doc.get("frames"), FRAMES_MAX):
        ns, size = _list(named, 2, 2)
        end = at + _whole(size)
        frames.append((_whole(ns, 1 << 63), rest[at:end]))
        at = end
    if at != len(rest):
        raise ValueError("relayed message: of another length than it says")
    events = []
    for text in _list(doc.get("events"), EVENTS_MAX):
        if not isinstance(text, str):
            raise ValueError("relayed message: an event is no text")
        events.append(_event(_loads(text)))
    return StreamUpdate(
        view=_view(doc.get("view")),
        generation=_whole(doc.get("generation")),
        run_id=_run(doc.get("run")),
        version=_name(doc.get("version")),
        numbering=_name(doc.get("numbering")),
        late_s=_seconds(doc.get("late")),
        frames=tuple(frames),
        events=tuple(events),
        sent_s=_sent(doc),
    )


def _loads(data: bytes | str) -> object:
    try:
        return loads(data)
    except ValueError as e:  # of a number as well that has too many digits
        raise ValueError(f"relayed message: {str(e)[:200]}") from None


def _object(data: bytes, what: str) -> dict[str, Any]:
    doc = _loads(data)
    if not isinstance(doc, dict):
        raise ValueError(f"relayed message: {what} is no object")
    return doc


def _event(doc: object) -> str:
    """As its bytes go to viewers."""
    if not isinstance(doc, dict) or doc.get("type") != "event":
        raise ValueError("relayed message: an event is none")
    _whole(doc.get("n"))
    text = dump(doc).decode()
    if len(text) > EVENT_BYTES_MAX:
        raise ValueError("relayed message: an event is too long")
    return text


def _list(value: object, most: int, least: int = 0) -> list[Any]:
    if not isinstance(value, list) or not least <= len(value) <= most:
        raise ValueError(f"relayed message: no list of {least} to {most}")
    return value


def _views(doc: dict[str, Any], name: str) -> list[tuple[object, Any]]:
    value = doc.get(name, {})  # an older relay says less
    if not isinstance(value, dict) or len(value) > VIEWS_MAX:
        raise ValueError(f"relayed message: {name} is no object of views")
    return list(value.items())


def _view(value: object) -> str:
    if not isinstance(value, str):
        raise ValueError("relayed message: a view is no text")
    return check_name("view", value)


def _name(value: object) -> str:
    if not isinstance(value, str) or len(value) > NAME_MAX:
        raise ValueError(f"relayed message: no text of up to {NAME_MAX} characters")
    return value


def _whole(value: object, most: int = WHOLE_MAX) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
        raise ValueError("relayed message: no whole number in range")
    return value


def _seconds(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= SECONDS_MAX:
        raise ValueError("relayed message: no time in range")
    return float(value)


def _sent(doc: dict[str, Any]) -> float | None:
    return None if doc.get("sent") is None else _seconds(doc["sent"])


def _run(value: object) -> int:
    if not isinstance(value, str) or not HEX.fullmatch(value) or int(value, 16) == 0:
        raise ValueError("relayed message: no run")
    return int(value, 16)


def _bytes(fields: Mapping[bytes, bytes], name: bytes, most: int) -> bytes:
    value = fields.get(name)
    if value is None or len(value) > most:
        raise ValueError(f"state: {name.decode()} is missing or too long")
    return value


def _digits(fields: Mapping[bytes, bytes], name: bytes) -> int:
    text = _bytes(fields, name, 20)
    if not text.isdigit():
        raise ValueError(f"state: {name.decode()} is no number")
    return _whole(int(text), 1 << 63)


def _rounded(seconds: float | None) -> float | None:
    return None if seconds is None or not math.isfinite(seconds) else round(seconds, 4)


Value = bytes | str | int


class WrittenState(NamedTuple):
    """The part of a stream's state that was already sent."""

    generation: int
    key: StoredFrame
    version: int
    event_n: int
    is_heard: bool


def describe_written(stream: Stream, generation: int) -> WrittenState:
    """Return what others know of a stream after its whole state was sent. The stream must have a KEY."""
    assert stream.key is not None
    is_heard = stream.live_at is not None
    return WrittenState(generation, stream.key, stream.version, stream.event_n, is_heard)


def make_update(
    stream: Stream,
    before: WrittenState | None,
    generation: int,
    names: tuple[str, str],
    now: float,
    sent_s: float | None,
) -> StreamUpdate:
    """Make the message with the changes of a stream. The stream must have a KEY.

    `before`: what was sent last; None: nothing. `names`: the names of the version and the numbering.
    """
    key, newest = stream.key, stream.newest
    assert key is not None
    assert newest is not None
    # what others lack, the KEY first; frames that were never live here come by the whole state alone
    age_s = stream.compute_age_s(now)
    lacking: list[StoredFrame] = []
    if age_s is not None:
        knows_key = key is newest or (before is not None and key is before.key)
        lacking = [newest] if knows_key else [key, newest]
    told_n = before.event_n if before is not None else 0
    return StreamUpdate(
        stream.view,
        generation,
        stream.run_id,
        *names,
        max(0.0, age_s or 0.0),
        tuple((compute_ns(held), held.payload) for held in lacking),
        tuple(event.text for event in stream.events if event.n > told_n),
        sent_s,
    )


def list_lasting_values(stream: Stream, names: tuple[str, str], is_heard: bool) -> list[Value]:
    """List the parts of a state that seldom change: names and values in turns, as `unpack_state` reads."""
    assert stream.key is not None
    values: list[Value] = ["run", f"{stream.run_id:016x}"]
    values += ["schema", stream.schema.text if stream.schema else ""]
    values += ["key", stream.key.payload, "ref", b""]  # an older relay refuses a state without `ref`
    values += ["info", dump(stream.info), "model", stream.model or ""]
    values += ["events", "[" + ",".join(event.text for event in stream.events) + "]"]
    values += ["version", names[0], "numbering", names[1]]
    return [*values, "heard", "1" if is_heard else "0"]


def make_presence(robot: Robot, now: float, sent_s: float | None) -> Presence:
    """Make the message with a robot's presence and the age of its frames."""
    ages_s: dict[str, float | None] = {}
    newest: dict[str, tuple[int, int]] = {}
    for view, room in robot.rooms.items():
        age_s, held = room.stream.compute_age_s(now), room.stream.newest
        ages_s[view] = None if age_s is None else max(0.0, age_s)
        if held is not None:
            newest[view] = held.run_id, held.seq
    return Presence(robot.liveness.token, ages_s, newest, sent_s)


def compute_ns(held: StoredFrame) -> int:
    """Return a frame's time in nanoseconds since the agent's run began."""
    return round(held.stamp_s * 1e9)
