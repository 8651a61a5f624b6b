"""MCAP files of the library's own writer, with CDR packed by hand: the decoder had no part in either."""

from __future__ import annotations

import io
import struct

from mcap.writer import CompressionType, Writer

BEGAN_NS = 1_700_000_000_000_000_000
STEP_NS = 10_000_000


class Cdr:
    """Little-endian CDR."""

    def __init__(self) -> None:
        self._out = bytearray()

    def put(self, form: str, *values: float) -> Cdr:
        size = struct.calcsize(form[0])
        self._out += bytes(-len(self._out) % size) + struct.pack(f"<{len(values)}{form[0]}", *values)
        return self

    def text(self, value: str) -> Cdr:
        raw = value.encode() + b"\0"
        self.put("I", len(raw))
        self._out += raw
        return self

    def doubles(self, *values: float) -> Cdr:
        self.put("I", len(values))
        return self.put("d", *values) if values else self

    @property
    def payload(self) -> bytes:
        return b"\x00\x01\x00\x00" + bytes(self._out)


def header(t_ns: int, frame: str = "") -> Cdr:
    return Cdr().put("i", t_ns // 10**9).put("I", t_ns % 10**9).text(frame)


def joint_state(t_ns: int, **position: float) -> bytes:
    cdr = header(t_ns).put("I", len(position))
    for name in position:
        cdr.text(name)
    return cdr.doubles(*position.values()).doubles().doubles().payload


def wrench(t_ns: int, frame: str, *six: float) -> bytes:
    return header(t_ns, frame).put("d", *six).payload


class Bag:
    """A file in the making."""

    def __init__(self, compression: CompressionType = CompressionType.ZSTD, chunk_bytes: int = 4096) -> None:
        self._file = io.BytesIO()
        self._writer = Writer(self._file, compression=compression, chunk_size=chunk_bytes)
        self._writer.start(profile="ros2")
        self._channels: dict[str, int] = {}

    def add(self, topic: str, type_name: str, t_ns: int, data: bytes, encoding: str = "cdr") -> None:
        if topic not in self._channels:
            schema = self._writer.register_schema(type_name, "ros2msg", b"")
            self._channels[topic] = self._writer.register_channel(topic, encoding, schema)
        self._writer.add_message(self._channels[topic], t_ns, data, t_ns)

    def finish(self) -> bytes:
        self._writer.finish()  # type: ignore[no-untyped-call]
        return self._file.getvalue()
