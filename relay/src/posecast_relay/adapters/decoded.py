"""Newest frames, decoded: once per frame, however many want them, and only when somebody does."""

from __future__ import annotations

import json
from weakref import WeakKeyDictionary

from posecast_wire import MISSING, DecodedFrame, Decoder, Field, Frame, FrameError, Schema

from posecast_relay.core.stream import Held, Stream


class _Reader:
    """Follows one stream of one schema."""

    def __init__(self, schema: Schema) -> None:
        self.schema = schema
        self.newest: Held | None = None
        self.frame: Frame | None = None
        self.text: str | None = None
        self._decoder = Decoder()
        self._decoder.add_schema(schema.text)
        self._bases: tuple[Held | None, Held | None] = (None, None)

    def read(self, newest: Held) -> None:
        """Decode this frame unless it is the one read last."""
        if newest is self.newest:
            return
        self.newest, self.frame, self.text = newest, None, None
        bases = (newest.key, newest.ref)
        try:
            if bases != self._bases:
                for base in bases:
                    if base is not None:
                        self._decoder.decode(base.payload)
                self._bases = bases
            self.frame = self._decoder.decode(newest.payload)
        except FrameError:  # an edge has sent something that does not decode
            self._bases = (None, None)


class Decoded:
    """The newest frame of each stream."""

    def __init__(self) -> None:
        self._readers: WeakKeyDictionary[Stream, _Reader] = WeakKeyDictionary()

    def frame(self, stream: Stream) -> Frame | None:
        """None when there is none, or none that decodes."""
        reader = self._read(stream)
        return reader.frame if reader else None

    def text(self, stream: Stream) -> str | None:
        """The `frame` message of `format=json`."""
        reader = self._read(stream)
        if reader is None or reader.frame is None:
            return None
        if reader.text is None:
            reader.text = json.dumps(_message(reader.frame), separators=(",", ":"), ensure_ascii=False)
        return reader.text

    def _read(self, stream: Stream) -> _Reader | None:
        if stream.newest is None or stream.schema is None:
            return None
        reader = self._readers.get(stream)
        if reader is None or reader.schema is not stream.schema:
            reader = self._readers[stream] = _Reader(stream.schema)
        reader.read(stream.newest)
        return reader


def field_values(frame: Frame, field: Field) -> list[float | None]:
    """Values in the field's unit (bits: the mask), None where there is no reading."""
    if field.bits:
        codes = frame.codes[field.start : field.start + field.size]
        return [None if code == MISSING else code for code in codes]
    return [None if v is None else float(f"{v:.9g}") for v in field.values(frame.codes)]


def _message(frame: Frame) -> DecodedFrame:
    values = {field.name: field_values(frame, field) for field in frame.schema.fields}
    return {"type": "frame", "seq": frame.seq, "t": round(frame.t_s, 6), "values": values}
