"""Decodes newest frames, only on request and once per frame."""

from __future__ import annotations

import time
from collections.abc import Callable
from weakref import WeakKeyDictionary

from posecast_wire import MISSING, DecodedFrame, Decoder, Field, Frame, FrameError, Schema

from posecast_relay.core.stream import StoredFrame, Stream
from posecast_relay.kit import Turns, json_bytes

# Decoding takes a microsecond per channel, on the event loop that also serves all viewers.
ROBOT_CHANNELS_PER_S = 40_000  # decoded for one robot's viewers; further frames are skipped
CHANNELS_PER_S = 200_000  # for all robots, shared equally


class _Reader:
    """Follows one stream of one schema."""

    def __init__(self, schema: Schema) -> None:
        self.schema = schema
        self.newest: StoredFrame | None = None
        self.frame: Frame | None = None
        self.text: str | None = None
        self._decoder = Decoder()
        self._decoder.add_schema(schema.text)
        self._key: StoredFrame | None = None  # the one that the decoder holds

    def cost(self, newest: StoredFrame) -> int:
        """Return the number of channels to decode for this frame, including its KEY."""
        return self.schema.size if newest.key in (None, self._key) else 2 * self.schema.size

    def read(self, newest: StoredFrame) -> None:
        """Decode this frame."""
        self.newest, self.frame, self.text = newest, None, None
        try:
            if newest.key is not None and newest.key is not self._key:
                self._decoder.decode(newest.key.payload)
            self.frame = self._decoder.decode(newest.payload)
            self._key = newest.key or newest
        except FrameError:  # an agent sent an invalid frame
            self._key = None


class DecodeCache:
    """Decodes the newest frame of each stream, at a bounded rate per robot."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._turns = Turns(now, ROBOT_CHANNELS_PER_S, CHANNELS_PER_S)
        self._readers: WeakKeyDictionary[Stream, _Reader] = WeakKeyDictionary()

    def decode_frame(self, stream: Stream) -> Frame | None:
        """Return the newest frame, decoded; None if there is none or it can't be decoded now."""
        reader = self._read(stream)
        return reader.frame if reader else None

    def make_text(self, stream: Stream) -> str | None:
        """Return the newest frame as a `frame` message of `format=json`; None likewise."""
        reader = self._read(stream)
        if reader is None or reader.frame is None:
            return None
        if reader.text is None:
            reader.text = json_bytes(_message(reader.frame)).decode()
        return reader.text

    def _read(self, stream: Stream) -> _Reader | None:
        if stream.newest is None or stream.schema is None:
            return None
        reader = self._readers.get(stream)
        if reader is None or reader.schema is not stream.schema:
            reader = self._readers[stream] = _Reader(stream.schema)
        if stream.newest is not reader.newest:
            if not self._turns.takes(stream.robot, reader.cost(stream.newest)):
                return None
            reader.read(stream.newest)
        return reader


def list_field_values(frame: Frame, field: Field) -> list[float | None]:
    """Return a field's values in its unit (for bits, the mask); None for a missing reading."""
    if field.bits:
        codes = frame.codes[field.start : field.start + field.size]
        return [None if code == MISSING else code for code in codes]
    return [None if v is None else float(f"{v:.9g}") for v in field.values(frame.codes)]


def _message(frame: Frame) -> DecodedFrame:
    values = {field.name: list_field_values(frame, field) for field in frame.schema.fields}
    return {"type": "frame", "seq": frame.seq, "t": round(frame.t_s, 6), "values": values}
