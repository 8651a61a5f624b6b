"""Converts the core's WebSocket messages to other formats: JSON and server-sent events.

The same bytes go to many viewers in a row, so the last result is cached: conversion happens once per frame
and rate, not once per viewer.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Callable
from typing import Protocol

from posecast_relay.core import messages
from posecast_relay.core.stream import Stream
from posecast_relay.core.viewer import Outlet
from posecast_relay.net.decode_cache import DecodeCache

# Converts the core's WebSocket messages to other formats: JSON and server-sent events.
#
# The same bytes go to many viewers in a row, so the last result is cached: conversion happens once per frame
# and rate, not once per viewer.

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
