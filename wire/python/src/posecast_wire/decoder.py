"""Decodes frames into codes. A frame that can't be decoded leaves the decoder unchanged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from posecast_wire.frame import HEADER, KEY_HEADER, BadFrame, BaseUnknown, Header, frame_id, parse_header
from posecast_wire.schema import CODE_MAX, MISSING, Schema

KEY_ORDER = 4
ALL_ZERO = 15


@dataclass(frozen=True)
class Frame:
    """One decoded frame. `t_s`: robot clock, seconds; `codes`: all channels in the schema's order."""

    schema: Schema
    seq: int
    t_s: float
    codes: tuple[int, ...]

    def values(self, name: str) -> list[float | None]:
        """The values of one field in its unit, None where there is no reading. Raises KeyError when the
        schema lacks it."""
        found = self.schema.find_field(name)
        if found is None:
            raise KeyError(name)
        return found.values(self.codes)


@dataclass(frozen=True)
class _Key:
    id: int
    frame: Frame
    orders: Sequence[int]


class Decoder:
    """Decodes the frames of a stream. It keeps the newest `max_schemas` schemas and the newest KEY."""

    def __init__(self, max_schemas: int = 4) -> None:
        self._max_schemas = max_schemas
        self._schemas: dict[int, Schema] = {}
        self._key: _Key | None = None

    def add_schema(self, text: str) -> Schema:
        """Add a schema given as its exact text. Raises SchemaError when it is invalid."""
        schema = Schema.parse(text)
        self._schemas.pop(schema.id, None)
        self._schemas[schema.id] = schema
        if len(self._schemas) > self._max_schemas:
            del self._schemas[next(iter(self._schemas))]
        return schema

    def decode(self, frame: bytes) -> Frame:
        """Decode a frame. Raises BadFrame, or BaseUnknown when its schema or base has not been received."""
        header = parse_header(frame)
        return self._decode_key(frame, header) if header.is_key else self._decode_from(frame, header)

    def _decode_key(self, frame: bytes, header: Header) -> Frame:
        schema = self._schemas.get(header.schema_id or 0)
        if schema is None:
            raise BaseUnknown(f"schema {header.schema_id:08x} is not here")
        _check_size(frame, schema.key_bytes_max)
        bits = _Bits(frame, KEY_HEADER.size)
        codes = _read_codes(bits, schema, (0,) * schema.size, (KEY_ORDER,) * schema.size)
        orders = [bits.take(4) for _ in range(schema.size)]
        bits.end()
        result = Frame(schema, header.seq, header.t, codes)
        self._key = _Key(frame_id(frame), result, orders)
        return result

    def _decode_from(self, frame: bytes, header: Header) -> Frame:
        key = self._key
        if key is None or key.id != header.base_id:
            raise BaseUnknown(f"base {header.base_id or 0:08x} is not here")
        of = key.frame
        _check_size(frame, of.schema.frame_bytes_max)
        bits = _Bits(frame, HEADER.size)
        codes = _read_codes(bits, of.schema, of.codes, key.orders)
        bits.end()
        return Frame(of.schema, (of.seq + header.seq) & 0xFFFFFFFF, of.t_s + header.t / 1000, codes)


def _check_size(frame: bytes, bytes_max: int) -> None:
    if len(frame) > bytes_max:
        raise BadFrame(f"frame of {len(frame)} bytes, {bytes_max} allowed by its schema")


class _Bits:
    """A frame's body as a string of 0 and 1, so that finding the next 1 is one fast call."""

    def __init__(self, frame: bytes, offset: int) -> None:
        body = frame[offset:]
        self.text = f"{int.from_bytes(body, 'big'):0{8 * len(body)}b}"
        self.at = 0

    def take(self, count: int) -> int:
        start, self.at = self.at, self.at + count
        if self.at > len(self.text):
            raise BadFrame("the body ends too early")
        return int(self.text[start : self.at], 2)

    def end(self) -> None:
        rest = self.text[self.at :]
        if len(rest) >= 8 or "1" in rest:
            raise BadFrame("more than zero padding after the last code")


def _read_codes(bits: _Bits, schema: Schema, base: Sequence[int], orders: Sequence[int]) -> tuple[int, ...]:
    text, size = bits.text, len(bits.text)
    moved: list[int] = []
    for f in schema.fields:
        n = bits.take(4)
        partner = schema.find_field(f.rel) if f.rel else None
        offset = partner.start - f.start if partner else 0
        if n == ALL_ZERO:
            moved += moved[partner.start : partner.start + f.size] if partner else [0] * f.size
            continue
        at = bits.at
        for i in range(f.start, f.start + f.size):
            k = min(15, max(0, orders[i] + n - 4))
            one = text.find("1", at)
            end = one + one - at + k + 1
            if one < 0 or end > size:
                raise BadFrame("the body ends too early")
            if one - at + k > 31:
                raise BadFrame("a residual past the range")
            z = int(text[one:end], 2) - (1 << k)
            r = -(z >> 1) - 1 if z & 1 else z >> 1
            at = end
            moved.append(r + moved[i + offset] if partner else r)
        bits.at = at
    codes = tuple([b + d for b, d in zip(base, moved, strict=True)])
    if min(codes) < MISSING or max(codes) > CODE_MAX:
        raise BadFrame("a code past the range")
    return codes
