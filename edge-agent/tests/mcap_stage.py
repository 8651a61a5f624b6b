"""MCAP files of the library's own writer, with CDR packed by hand: the decoder had no part in either."""

from __future__ import annotations

import io

from mcap.writer import CompressionType, Writer
from ros_stage import Cdr

BEGAN_NS = 1_700_000_000_000_000_000
STEP_NS = 10_000_000


def header(t_ns: int, frame: str = "") -> Cdr:
    return Cdr().put("i", t_ns // 10**9).put("I", t_ns % 10**9).text(frame)


def joint_state(t_ns: int, **position: float) -> bytes:
    cdr = header(t_ns).texts(list(position)).doubles(list(position.values()))
    return cdr.doubles([]).doubles([]).done()


def wrench(t_ns: int, frame: str, *six: float) -> bytes:
    return header(t_ns, frame).put("d", *six).done()


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
