"""The newest state as plain JSON, for curl, notebooks and students. Decoded only when somebody asks."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

from posecast_wire import MISSING, Frame

from posecast_relay.adapters.decoded import Decoded, field_values
from posecast_relay.core.robot import Robot
from posecast_relay.core.room import Room
from posecast_relay.core.stream import Stream

DECODE_S = 0.1  # at most ten times a second, however many ask


class StateReader:
    """Decodes a stream's newest frame, at most ten times a second per stream."""

    def __init__(self, now: Callable[[], float], decoded: Decoded) -> None:
        self._now = now
        self._newest = decoded
        self._decoded: WeakKeyDictionary[Stream, tuple[float, Frame]] = WeakKeyDictionary()

    def read(self, robot: Robot, room: Room) -> bytes:
        """The JSON text. The stream has a newest frame."""
        now, stream = self._now(), room.stream
        known = self._decoded.get(stream)
        if known is None or now - known[0] >= DECODE_S:
            frame = self._newest.frame(stream)
            if frame is not None:
                known = self._decoded[stream] = (now, frame)
        age_s = stream.age_s(now)
        document: dict[str, Any] = {
            "robot": stream.robot,
            "view": stream.view,
            "status": robot.word(room, now),
            "age_ms": None if age_s is None else max(0, round(age_s * 1000)),
            "info": stream.info,
        }
        if known is not None:
            document |= {"seq": known[1].seq, "t": round(known[1].t_s, 6), "fields": _fields(known[1])}
        return json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode()


def _fields(frame: Frame) -> dict[str, Any]:
    """Values by field and label; a field of bits as the names of those set."""
    found: dict[str, Any] = {}
    for field in frame.schema.fields:
        codes = frame.codes[field.start : field.start + field.size]
        if field.bits:
            values: list[Any] = [None if c == MISSING else field.bits_set(c) for c in codes]
        else:
            values = list(field_values(frame, field))
        found[field.name] = {"unit": field.unit, "values": dict(zip(field.labels, values, strict=True))}
    return found
