"""Converts the core's WebSocket messages to other formats: JSON and server-sent events.

The same bytes go to many viewers in a row, so the last result is cached: conversion happens once per frame
and rate, not once per viewer.

Newest frames are decoded only on request, and once per frame.
"""

from __future__ import annotations

import base64
import json
import re
import time
from collections.abc import Callable
from typing import Protocol
from weakref import WeakKeyDictionary

from posecast_wire import MISSING, DecodedFrame, Decoder, Field, Frame, FrameError, Schema

from posecast_relay.core import messages
from posecast_relay.core.stream import StoredFrame, Stream
from posecast_relay.core.viewer import Outlet
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
        """Return the newest frame as a `frame` message of `format=json`; None as in `decode_frame`."""
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


TEXT, BINARY = 1, 2  # WebSocket opcodes
LINE_END = re.compile(r"\r\n|\r|\n")


class Encoding(Protocol):
    """A format of the stream that a viewer can request."""

    def encode(self, data: bytes, stream: Stream) -> bytes:
        """Convert WebSocket messages of this stream to this format."""


class JsonEncoding:
    """Frames as JSON text messages. Bases are left out: a decoded frame does not need them."""

    def __init__(self, decoded: DecodeCache) -> None:
        self._decoded = decoded
        self._last = (b"", b"")

    def encode(self, data: bytes, stream: Stream) -> bytes:
        """Replace the binary messages with the newest frame as JSON, always the last message of a write."""
        if data is not self._last[0]:
            found = list(messages.split_messages(data))
            parts = [messages.pack_message(opcode, payload) for opcode, payload in found if opcode != BINARY]
            if len(parts) < len(found):
                text = self._decoded.make_text(stream)
                parts += [messages.make_text(text)] if text is not None else []
            self._last = (data, b"".join(parts))
        return self._last[1]


class JsonOutlet:
    """The outlet of a viewer that asked for `format=json`. Its `write` converts the messages."""

    descriptor = -1

    def __init__(self, socket: Outlet, write: Callable[[bytes], object]) -> None:
        self._socket = socket
        self._write = write
        self.end = socket.end
        self.cut = socket.cut

    def write(self, data: bytes) -> None:
        """Convert these bytes and write them."""
        self._write(data)


class EventStreamEncoding:
    """Server-sent events: each message as an event named by its type, binary frames in base64."""

    def __init__(self, inner: Encoding | None = None) -> None:
        self._inner = inner
        self._last = (b"", b"")

    def encode(self, data: bytes, stream: Stream) -> bytes:
        """Convert WebSocket messages to lines of `text/event-stream`."""
        if data is not self._last[0]:
            inner = self._inner.encode(data, stream) if self._inner else data
            self._last = (
                data,
                b"".join(_make_event(op, payload) for op, payload in messages.split_messages(inner)),
            )
        return self._last[1]


def _make_event(opcode: int, payload: bytes) -> bytes:
    if opcode == BINARY:
        return b"event: frame\ndata: " + base64.b64encode(payload) + b"\n\n"
    if opcode != TEXT:
        return b""
    text = payload.decode()
    lines = "".join(f"data: {line}\n" for line in LINE_END.split(text))
    return f"event: {json.loads(text)['type']}\n{lines}\n".encode()
