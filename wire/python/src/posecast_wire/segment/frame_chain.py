"""Follows the frames of a segment by their headers: each has its base here, and their numbers rise."""

from __future__ import annotations

from posecast_wire.fnv import fnv1a32
from posecast_wire.frame import BadFrame, Header, parse_header
from posecast_wire.segment.records import SegmentError

SEQS = 1 << 32  # a frame's number goes round


class FrameChain:
    """The newest KEY, and the numbers of the frames so far. What is refused leaves it unchanged."""

    def __init__(self) -> None:
        self.count = 0
        self.copies = 0
        self.first_seq = 0
        self.last_seq = 0
        self._schema_id: int | None = None
        self._key: tuple[int, int] | None = None  # its id and seq

    def add_copy(self, frame: bytes) -> None:
        """Take a copy of the KEY. Raises SegmentError when it may not stand here."""
        header = _parse(frame)
        if self.count:
            raise SegmentError("copy: behind a frame")
        if self.copies or not header.is_key:
            raise SegmentError("copy: want one KEY")
        self._take(frame, header)
        self.copies += 1

    def add_frame(self, frame: bytes) -> int:
        """Take a frame and return its number. Raises SegmentError when it may not stand here."""
        header = _parse(frame)
        if header.is_key:
            if self.copies and not self.count:
                raise SegmentError("frame: a KEY behind copies")
            if self._schema_id not in (None, header.schema_id):
                raise SegmentError("frame: a KEY of another schema")
        seq = self._seq(header)
        if self.count and (seq - self.last_seq - 1) % SEQS >= SEQS // 2:
            raise SegmentError(f"frame: number {seq} after {self.last_seq}")
        if header.is_key:
            self._take(frame, header)
        if not self.count:
            self.first_seq = seq
        self.last_seq = seq
        self.count += 1
        return seq

    def _take(self, frame: bytes, header: Header) -> None:
        self._key, self._schema_id = (fnv1a32(frame), header.seq), header.schema_id

    def _seq(self, header: Header) -> int:
        if header.is_key:
            return header.seq
        if self._key is not None and self._key[0] == header.base_id:
            return (self._key[1] + header.seq) % SEQS
        raise SegmentError(f"frame: its base {header.base_id:08x} is not here")


def _parse(frame: bytes) -> Header:
    try:
        return parse_header(frame)
    except BadFrame as e:
        raise SegmentError(f"frame: {e}") from None
