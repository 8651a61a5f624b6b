"""The schema: the channels of a stream, their order, and the unit and step of their codes."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping as ReadOnly
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

from posecast_wire.checked import (
    SchemaError,
    check_entries,
    check_list,
    check_number,
    check_table,
    check_text,
    check_texts,
    fail,
    loads,
)
from posecast_wire.fnv import fnv1a32
from posecast_wire.mapping import Mapping, parse_mapping

MISSING = -(1 << 28)  # the code of "no reading"
CODE_MAX = (1 << 28) - 1  # codes of readings are in -CODE_MAX … CODE_MAX
BITS_MAX = 28
CHANNELS_MAX = 4096
TEXT_BYTES_MAX = 1 << 18
FIELD_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,62}")

__all__ = ["CODE_MAX", "MISSING", "Field", "Schema", "SchemaError", "build_schema_text"]


@dataclass(frozen=True)
class Field:
    """A field: channels `start` … `start + size - 1` of the code vector; value = code · scale, in `unit`."""

    name: str
    labels: tuple[str, ...]
    label_set: str
    unit: str
    scale: float
    rel: str | None  # the earlier field whose changes this one shares
    bits: tuple[str, ...]  # names, lowest bit first; empty for a number
    slow: bool
    start: int

    @property
    def size(self) -> int:
        """Number of channels."""
        return len(self.labels)

    def values(self, codes: Sequence[int]) -> list[float | None]:
        """This field's values from a complete code vector, in `unit`; None where there is no reading."""
        scale = self.scale
        return [None if c == MISSING else c * scale for c in codes[self.start : self.start + self.size]]

    def bits_set(self, code: int) -> list[str]:
        """Names of the bits that are set in a code of a `bits` field; a bit without a name is called `bit
        N`."""
        if code == MISSING:
            return []
        named = self.bits
        return [named[i] if i < len(named) else f"bit {i}" for i in range(code.bit_length()) if code >> i & 1]


@dataclass(frozen=True)
class Schema:
    """A parsed schema. `text`: the exact text received; `id`: its FNV-1a-32, by which KEY frames refer to
    it."""

    text: str
    id: int
    robot: str
    fields: tuple[Field, ...]
    size: int
    mapping: Mapping

    @property
    def key_bytes_max(self) -> int:
        """Upper bound for the bytes of a KEY frame (SPEC §4): a code takes 63 bits at most, its order 4."""
        return 17 + (4 * len(self.fields) + 67 * self.size + 7) // 8

    @property
    def frame_bytes_max(self) -> int:
        """Upper bound for the bytes of a plain frame."""
        return 9 + (4 * len(self.fields) + 63 * self.size + 7) // 8

    def find_field(self, name: str) -> Field | None:
        """The field of that name, or None."""
        return self._by_name.get(name)

    @cached_property
    def _by_name(self) -> dict[str, Field]:
        return {f.name: f for f in self.fields}

    @classmethod
    def parse(cls, text: str) -> Schema:
        """Parse a schema's JSON text, ignoring unknown members. Raises SchemaError, which says what is wrong
        and where."""
        try:
            raw = text.encode()
            if len(raw) > TEXT_BYTES_MAX:
                fail("schema", f"longer than {TEXT_BYTES_MAX} bytes")
            doc = loads(text)
        except SchemaError:
            raise
        except ValueError as e:
            raise SchemaError(f"schema: not JSON: {e}") from None
        return _parse(text, fnv1a32(raw), doc)


def _parse(whole: str, schema_id: int, document: object) -> Schema:
    doc = check_table(document, "schema")
    if doc.get("type") != "schema":
        fail("type", 'must be "schema"')
    if doc.get("v") != 1 or isinstance(doc.get("v"), bool):
        fail("v", "this reader knows version 1 only")
    sets = {k: check_texts(v, at, CHANNELS_MAX) for k, v, at in check_entries(doc.get("labels"), "labels")}
    fields: dict[str, Field] = {}
    size = 0
    for i, item in enumerate(check_list(doc.get("fields"), "fields")):
        found = _field(check_table(item, f"fields[{i}]"), f"fields[{i}]", sets, fields, size)
        fields[found.name] = found
        size += found.size
        if size > CHANNELS_MAX:
            fail(f"fields[{i}]", f"more than {CHANNELS_MAX} channels in all")
    if not fields:
        fail("fields", "must name at least one field")
    mapping = parse_mapping(doc.get("mapping"))
    return Schema(
        whole, schema_id, check_text(doc.get("robot"), "robot"), tuple(fields.values()), size, mapping
    )


def _field(
    doc: dict[str, object],
    where: str,
    sets: dict[str, tuple[str, ...]],
    earlier: dict[str, Field],
    start: int,
) -> Field:
    name = check_text(doc.get("name"), f"{where}.name")
    if not FIELD_NAME.fullmatch(name):
        fail(f"{where}.name", f"'{name}' must be a letter or _ and then letters, digits or _, 63 at most")
    if name in earlier:
        fail(f"{where}.name", f"'{name}' appears twice")
    label_set = check_text(doc.get("labels"), f"{where}.labels")
    labels = sets.get(label_set)
    if not labels:
        fail(f"{where}.labels", f"no such label set, or an empty one: '{label_set}'")
    scale = check_number(doc.get("scale", 1), f"{where}.scale")
    if not 1e-12 <= scale <= 1e12:
        fail(f"{where}.scale", "must lie between 1e-12 and 1e12")
    unit = doc.get("unit", "")
    bits = check_texts(doc.get("bits", []), f"{where}.bits", BITS_MAX)
    if bits and scale != 1:
        fail(f"{where}.scale", "a field of bits has scale 1")
    rel = doc.get("rel")
    if rel is not None:
        partner = earlier.get(check_text(rel, f"{where}.rel"))
        if partner is None:
            fail(f"{where}.rel", f"no earlier field '{rel}'")
        if partner.size != len(labels):
            fail(f"{where}.rel", f"'{partner.name}' has {partner.size} channels, not {len(labels)}")
    slow = doc.get("slow", False)
    if not isinstance(slow, bool):
        fail(f"{where}.slow", "must be true or false")
    return Field(
        name=name,
        labels=labels,
        label_set=label_set,
        unit=check_text(unit, f"{where}.unit") if unit != "" else "",
        scale=scale,
        rel=cast("str | None", rel),
        bits=bits,
        slow=slow,
        start=start,
    )


def build_schema_text(
    robot: str,
    labels: ReadOnly[str, Sequence[str]],
    fields: Sequence[ReadOnly[str, object]],
    mapping: ReadOnly[str, object] | None = None,
) -> str:
    """Make the JSON text of a schema, compact and with members in a fixed order. Raises SchemaError when it
    is invalid.

    `fields`: objects with the members of SPEC's table (`name`, `labels`, `unit`, `scale`, `rel`, `bits`,
    `slow`); members that are None, empty or equal to their default are left out.
    """
    silent: dict[str, object] = {"unit": "", "scale": 1, "rel": None, "bits": [], "slow": False}
    order = ("name", "labels", *silent)
    doc: dict[str, object] = {"type": "schema", "v": 1, "robot": robot}
    doc["labels"] = {name: list(of_set) for name, of_set in labels.items()}
    doc["fields"] = [
        {k: _plain(f[k]) for k in order if k in f and _plain(f[k]) not in (None, silent.get(k))}
        for f in fields
    ]
    if mapping:
        doc["mapping"] = dict(mapping)
    try:
        written = json.dumps(doc, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    except (TypeError, ValueError) as e:
        raise SchemaError(f"schema: not JSON: {e}") from None
    return Schema.parse(written).text


def _plain(value: object) -> object:
    return list(value) if isinstance(value, tuple) else value
