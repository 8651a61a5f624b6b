"""Returns the newest state as plain JSON, for scripts and notebooks. Decodes only on request."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

from posecast_wire import MISSING, Frame

from posecast_relay.core.state.robot import Robot
from posecast_relay.core.state.room import Room
from posecast_relay.core.state.stream import Stream
from posecast_relay.plain_json import json_bytes
from posecast_relay.streaming.decode_cache import DecodeCache, list_field_values

DECODE_S = 0.1  # minimum time between two decodings, for any number of requests


class _Known(NamedTuple):
    """A decoded frame, as JSON, with its age at that time."""

    at: float
    age_s: float
    text: bytes  # its members of the document


class StateReader:
    """Decodes a stream's newest frame, at most ten times a second per stream, or at the grant's rate."""

    def __init__(self, now: Callable[[], float], decoded: DecodeCache) -> None:
        self._now = now
        self._newest = decoded
        self._known: WeakKeyDictionary[Stream, dict[float, _Known]] = WeakKeyDictionary()

    def read(self, robot: Robot, room: Room, hz: float) -> bytes:
        """Return a room's newest state as JSON. `hz`: how often it may be decoded.

        The room must have a newest frame.
        """
        now, stream = self._now(), room.stream
        every_s = max(DECODE_S, 1 / hz)
        of_stream = self._known.setdefault(stream, {})  # by rate: at most as many as the policy has
        known = of_stream.get(every_s)
        age_s = stream.compute_age_s(now)
        if known is None or now - known.at >= every_s:
            frame = self._newest.decode_frame(stream)
            if frame is not None:
                known = of_stream[every_s] = _Known(now, age_s or 0.0, _encode_frame(frame))
        if known is not None:  # the age of the decoded frame: a newer one may not be decoded yet
            age_s = known.age_s + now - known.at
        document = {
            "robot": stream.robot,
            "view": stream.view,
            "status": robot.compute_status(room, now),
            "age_ms": None if age_s is None else max(0, round(age_s * 1000)),
            "info": stream.info,
        }
        return json_bytes(document)[:-1] + (b"" if known is None else known.text) + b"}"


def _encode_frame(frame: Frame) -> bytes:
    """Encode a frame as the last members of the JSON document."""
    document = {"seq": frame.seq, "t": round(frame.t_s, 6), "fields": _read_fields(frame)}
    return b"," + json_bytes(document)[1:-1]


def _read_fields(frame: Frame) -> dict[str, Any]:
    """Return the values by field and label; for a field of bits, the names of the set bits."""
    found: dict[str, Any] = {}
    for field in frame.schema.fields:
        codes = frame.codes[field.start : field.start + field.size]
        if field.bits:
            values: list[Any] = [None if c == MISSING else field.bits_set(c) for c in codes]
        else:
            values = list(list_field_values(frame, field))
        found[field.name] = {"unit": field.unit, "values": dict(zip(field.labels, values, strict=True))}
        if units := frame.schema.mapping.units.get(field.name):
            found[field.name]["units"] = dict(units)  # of channels with a different unit
    return found
