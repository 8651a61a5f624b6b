"""Encodes codes as frames (SPEC "Frames"). Pure Python, about 0.15 ms for 244 channels."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from math import floor, isfinite
from operator import add, getitem, sub
from typing import NamedTuple

from posecast_wire.frame import HEADER, KEY_HEADER, TAG_KEY, TAG_PLAIN, frame_id
from posecast_wire.schema import CODE_MAX, MISSING, Field, Schema

ORDER_MAX = 15  # of the exp-Golomb code
KEY_ORDER = 4  # every channel's order in a KEY's own body
NEW_ORDER = 3  # a channel's order before any statistics
NIBBLE_MAX = 14
NIBBLES = [f"{n:04b}" for n in range(16)]
ALL_ZERO = "1111"  # the nibble of a field that did not change
LEARNING_FRAMES = 8  # as many as an idle robot sends in a KEY interval
KEPT_CODES = 1024  # per order: 0.15 MB, and a robot needs few of the 16 orders
# order = round(log2(0.69 × mean z)), as thresholds on the mean so that both languages agree to the bit
ORDER_STEPS = tuple(1.0247924945978928 * (1 << k) for k in range(1, ORDER_MAX + 1))


def encode_golomb(z: int, k: int) -> str:
    """The Exp-Golomb code of z ≥ 0 with order k, as a string of 0 and 1."""
    bits = f"{z + (1 << k):b}"
    return "0" * (len(bits) - 1 - k) + bits


class _Codes(dict[int, str]):
    """The codes of one order, created on demand. Large ones are not kept."""

    def __init__(self, k: int) -> None:
        super().__init__()
        self._k = k

    def __missing__(self, z: int) -> str:
        code = encode_golomb(z, self._k)
        if z < KEPT_CODES:
            self[z] = code
        return code


CODES = [_Codes(k) for k in range(ORDER_MAX + 1)]


class Encoder:
    """Encodes one stream of one run. The interval between KEYs is measured on the monotonic clock, not in
    robot time."""

    def __init__(self, schema: Schema, key_interval_s: float = 4.0) -> None:
        if not key_interval_s > 0:
            raise ValueError(f"key interval of {key_interval_s} s")
        self.schema = schema
        self.key: bytes | None = None  # the newest KEY: the base of the frames after it
        self._key_interval_s = key_interval_s
        self._spans = [_Span.of(schema, f) for f in schema.fields]
        self._zeros = [0] * schema.size
        self._key_now_s = 0.0
        self._last_t_s = 0.0
        self._base = _Base(0, 0, 0.0, self._zeros)
        self._z_sums = [0] * schema.size
        self._z_frames = 0
        self._orders = [NEW_ORDER] * schema.size
        self._key_rows = _Rows([KEY_ORDER] * schema.size)
        self._rows = _Rows(self._orders)

    def encode(
        self, codes: Sequence[int], seq: int, t_s: float, now_s: float, force_key: bool = False
    ) -> bytes:
        """Encode a frame. `seq`: u32, growing; `t_s`: robot clock; `now_s`: monotonic clock; both in seconds.

        Set `force_key` after the link came up; use a new Encoder for a new run or schema. Raises ValueError
        when codes, seq or t_s are out of range.
        """
        if len(codes) != self.schema.size:
            raise ValueError(f"{len(codes)} codes for {self.schema.size} channels")
        if min(codes) < MISSING or max(codes) > CODE_MAX:
            raise ValueError("a code past the range")
        if not (0 <= seq < 1 << 32 and isfinite(t_s)):
            raise ValueError(f"seq {seq}, t {t_s}: no frame can carry them")
        base = self._base
        distance = (seq - base.seq) & 0xFFFFFFFF
        t_ms = floor(max(-1.0, min(t_s - base.t_s, 66.0)) * 1000 + 0.5)
        stepped_back = t_s < self._last_t_s
        self._last_t_s = t_s
        if (
            force_key
            or self.key is None
            or not 0 <= now_s - self._key_now_s < self._key_interval_s
            or stepped_back
            or not 0 <= t_ms <= 0xFFFF
            or not 0 < distance <= 0xFFFF
        ):
            return self._encode_key(codes, seq, t_s, now_s)
        bits = self._body(codes, base.codes, self._rows, learn=True)
        self._z_frames += 1
        return HEADER.pack(TAG_PLAIN, base.id, distance, t_ms) + _packed(bits)

    def _encode_key(self, codes: Sequence[int], seq: int, t_s: float, now_s: float) -> bytes:
        if self._z_frames >= LEARNING_FRAMES:  # otherwise the old orders are better, and learning continues
            frames = self._z_frames
            self._orders = [bisect_right(ORDER_STEPS, total / frames) for total in self._z_sums]
            self._rows = _Rows(self._orders)
            self._z_sums = [0] * self.schema.size
            self._z_frames = 0
        bits = self._body(codes, self._zeros, self._key_rows, learn=False)
        frame = KEY_HEADER.pack(TAG_KEY, self.schema.id, seq, t_s)
        frame += _packed(bits + "".join([NIBBLES[k] for k in self._orders]))
        self._base = _Base(frame_id(frame), seq, t_s, list(codes))
        self._key_now_s = now_s
        self.key = frame
        return frame

    def _body(self, codes: Sequence[int], base: Sequence[int], rows: _Rows, learn: bool) -> str:
        """Return the bits of all fields against a base. `learn`: use the changes for later orders."""
        moved: dict[int, list[int]] = {}  # by the field's start; [] for an unchanged field, like most
        for start, stop, _ in self._spans:
            field, still = codes[start:stop], base[start:stop]
            moved[start] = [] if field == still else list(map(sub, field, still))
        parts: list[str] = []
        for start, stop, rel in self._spans:
            r = moved[start]
            if rel is not None and moved[rel]:
                r = list(map(sub, r or self._zeros, moved[rel]))
            if not any(r):
                parts.append(ALL_ZERO)
                continue
            z = [v + v if v >= 0 else -v - v - 1 for v in r]
            parts.append(rows.choose_shortest(start, stop, z))
            if learn:
                self._z_sums[start:stop] = map(add, self._z_sums[start:stop], z)
        return "".join(parts)


class _Base(NamedTuple):
    id: int
    seq: int
    t_s: float
    codes: list[int]


class _Span(NamedTuple):
    start: int
    stop: int
    rel: int | None  # where the partner's channels start

    @classmethod
    def of(cls, schema: Schema, f: Field) -> _Span:
        partner = schema.find_field(f.rel) if f.rel else None
        return cls(f.start, f.start + f.size, partner.start if partner else None)


class _Rows:
    """The rows of all fields for one table of orders; finds a field's best nibble."""

    def __init__(self, orders: list[int]) -> None:
        self._orders = orders
        self._rows: dict[tuple[int, int], _Row] = {}

    def choose_shortest(self, start: int, stop: int, z: list[int]) -> str:
        """Return the nibble and codes of one field, searching downhill from the value suggested by the mean
        z."""
        suggested = bisect_right(ORDER_STEPS, sum(z) / len(z))
        usual = sum(self._orders[start:stop]) // len(z)
        n = max(0, min(NIBBLE_MAX, suggested - usual + 4))
        least = self._row(start, stop, n).to_bits(z)
        for step in (1, -1):
            m = n + step
            while 0 <= m <= NIBBLE_MAX and (bits := self._row(start, stop, m).to_bits(z)) < least:
                least, n, m = bits, m, m + step
            if m != n + step:
                break  # downhill in this direction means uphill in the other
        return NIBBLES[n] + "".join(map(getitem, self._row(start, stop, n).codes, z))

    def _row(self, start: int, stop: int, n: int) -> _Row:
        row = self._rows.get((start, n))
        if row is None:
            orders = [max(0, min(ORDER_MAX, k + n - 4)) for k in self._orders[start:stop]]
            row = self._rows[start, n] = _Row.of(orders)
        return row


class _Row(NamedTuple):
    """One field's codes at one nibble."""

    codes: list[_Codes]
    powers: list[int]  # 2 to the order
    fixed_bits: int  # of all channels: the order and 1

    @classmethod
    def of(cls, orders: list[int]) -> _Row:
        return cls([CODES[k] for k in orders], [1 << k for k in orders], sum(orders) + len(orders))

    def to_bits(self, z: list[int]) -> int:
        """Return the length of the codes without making them.

        Each has as many zeros before its first 1 as bits after it, not counting the order.
        """
        return 2 * sum(map(int.bit_length, map(add, z, self.powers))) - self.fixed_bits


def _packed(bits: str) -> bytes:
    """Bits, first one highest, padded with zeros to whole bytes."""
    size = (len(bits) + 7) // 8
    return (int(bits, 2) << (8 * size - len(bits))).to_bytes(size, "big")
