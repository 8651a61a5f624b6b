"""Converts readings to codes, with hysteresis so that sensor noise costs no bytes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import floor, inf, isfinite

from posecast_wire.schema import CODE_MAX, MISSING, Field, Schema


class Quantiser:
    """Keeps the last code of every channel; a code changes only when the value differs from it by more than
    0.5 + deadband steps."""

    def __init__(
        self,
        schema: Schema,
        deadband_lsb: float | Mapping[str, float] = 0.3,
        strides: Mapping[str, Mapping[str, int]] | None = None,
    ) -> None:
        """`deadband_lsb`: in code steps, for all fields or by field name (0.3 where unnamed); 0 = round.

        `strides`: by field name and label, for channels that need not be as fine as their field: their codes
        are multiples of so many steps, and the deadband counts in these.
        """
        self._size = schema.size
        self._fields: list[_FieldCodes] = []
        for f in schema.fields:
            h = deadband_lsb.get(f.name, 0.3) if isinstance(deadband_lsb, Mapping) else deadband_lsb
            if not 0 <= h <= 1e6:
                raise ValueError(f"deadband of {f.name}: {h} is not a number of code steps")
            of_field = (strides or {}).get(f.name, {})
            self._fields.append(_FieldCodes(f, h, [of_field.get(label, 1) for label in f.labels]))

    def quantise(self, values: Sequence[float | None]) -> list[int]:
        """Convert one sample's values, in the schema's channel order and units, to codes. Raises ValueError
        on a wrong length.

        None, NaN and ±inf become MISSING, as does a bit mask that is not an integer in 0 … 2^28-1. Numbers
        out of range are clipped.
        """
        if len(values) != self._size:
            raise ValueError(f"{len(values)} values for {self._size} channels")
        codes: list[int] = []
        for f in self._fields:
            codes += f.quantise(values[f.start : f.stop])
        return codes


class _FieldCodes:
    """The last codes of one field, and their values: many do not change from frame to frame."""

    def __init__(self, f: Field, deadband_lsb: float, strides: Sequence[int]) -> None:
        self.start, self.stop = f.start, f.start + f.size
        self._scale = f.scale
        self._strides = strides if any(n != 1 for n in strides) else None
        self._keep = 0.0 if f.bits else 0.5 + deadband_lsb
        self._bits = bool(f.bits)
        self._values: Sequence[float | None] = ()
        self._codes = [MISSING] * f.size

    def quantise(self, values: Sequence[float | None]) -> list[int]:
        if values == self._values:
            return self._codes
        self._values = values
        if self._strides is not None:
            self._codes = [
                self._stride(v, n, old) for v, n, old in zip(values, self._strides, self._codes, strict=True)
            ]
            return self._codes
        scale, keep, last, bits = self._scale, self._keep, self._codes, self._bits
        for i, v in enumerate(values):
            if v is None:
                last[i] = MISSING
                continue
            try:
                x = v / scale
            except OverflowError:  # an int too large for a float
                x = inf
            old = last[i]
            if -keep <= x - old <= keep and old != MISSING:  # NaN fails this and every comparison
                continue
            if not -CODE_MAX <= x <= CODE_MAX:
                last[i] = MISSING if bits or not isfinite(x) else CODE_MAX if x > 0 else -CODE_MAX
            elif bits:
                last[i] = int(x) if x == int(x) and x >= 0 else MISSING
            else:
                last[i] = floor(x + 0.5)
        return last

    def _stride(self, v: float | None, stride: int, old: int) -> int:
        """The code of a number, as a multiple of `stride` steps."""
        if v is None:
            return MISSING
        try:
            x = v / (self._scale * stride)
        except OverflowError:
            x = inf
        if old != MISSING and -self._keep <= x - old / stride <= self._keep:
            return old
        most = CODE_MAX // stride
        if not -most <= x <= most:
            return MISSING if not isfinite(x) else most * stride if x > 0 else -most * stride
        return floor(x + 0.5) * stride
