"""The schema: the channels of a stream, their order, the unit and step of their codes, and what they mean for
the model (joints, sensor mounts, names, limits)."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Sequence
from collections.abc import Mapping as ReadOnly
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, TypeVar, cast

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

MISSING = -(1 << 28)  # the code of "no reading"
CODE_MAX = (1 << 28) - 1  # codes of readings are in -CODE_MAX … CODE_MAX
BITS_MAX = 28
CHANNELS_MAX = 4096
TEXT_BYTES_MAX = 1 << 18
FIELD_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,62}")

ANY = "*"
JOINT = "joint"  # the label set whose channels move the body
SENSOR_KINDS = ("wrench", "imu", "power")
SEVERITIES = ("fault", "caution", "state")
GROUNDS = ("measured", "lowest")
FEET_MAX = 16
CORNERS_MAX = 64  # of a sole
LANGUAGES_MAX = 16  # of one bit
SENTENCES_BYTES_MAX = 32 << 10  # in UTF-8: every viewer gets them before the first frame

Severity = Literal["fault", "caution", "state"]
Ground = Literal["measured", "lowest"]
Level = Literal["ok", "caution", "fault"]
Xyz = tuple[float, float, float]
T = TypeVar("T")


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
class JointMap:
    """Position of a URDF joint = Σ gain · channel + offset, for both pos and ref (rad, or m for a prismatic
    joint)."""

    terms: tuple[tuple[str, float], ...]
    offset: float = 0.0


@dataclass(frozen=True)
class SensorMount:
    """Where a sensor is mounted, relative to its link: `xyz` in metres, `rpy` in rad (fixed axes X, Y, Z as
    in URDF)."""

    kind: str
    name: str
    link: str | None
    xyz: Xyz = (0.0, 0.0, 0.0)
    rpy: Xyz = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Threshold:
    """Limits in the field's unit. `caution` in (0, 1]: the fraction of a limit at which caution begins."""

    low: float | None = None
    high: float | None = None
    caution: float = 1.0

    def find_level(self, value: float | None) -> Level:
        """`fault` beyond a limit, else `caution` from the fraction `caution` of a limit on (for a lower limit
        above zero: from limit / caution down), else `ok`."""
        if value is None or math.isnan(value):
            return "ok"
        worst: Level = "ok"
        for limit, sign in ((self.high, 1.0), (self.low, -1.0)):
            if limit is None:
                continue
            if (value - limit) * sign > 0:
                return "fault"
            # towards rest is a smaller number above zero, and for a lower limit above zero a larger one
            start = limit * self.caution if limit * sign >= 0 else limit / self.caution
            if (value - start) * sign > 0:
                worst = "caution"
        return worst


@dataclass(frozen=True)
class Sentence:
    """The meaning of a bit in one language. `say`: with placeholders for names and values (SPEC §2); `why`:
    one more sentence, or None."""

    say: str
    why: str | None = None


@dataclass(frozen=True)
class BalanceRule:
    """What the robot stands on.

    `feet`: sites of wrench sensors, or links; `ground`: how to find the loaded feet, by their wrench or as
    the lowest; `soles`: the corners of a foot's sole, in metres in its link, by its name in `feet`. Missing
    parts come from the model and the sensors (docs/reference/model-bundle.md).
    """

    feet: tuple[str, ...] | None = None
    ground: Ground | None = None
    soles: ReadOnly[str, tuple[Xyz, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Mapping:
    """What channels mean for the model. All parts are optional and keyed by names of channels, sites, fields
    and bits."""

    joints: ReadOnly[str, JointMap] = field(default_factory=dict)
    sensors: ReadOnly[str, SensorMount] = field(default_factory=dict)
    names: ReadOnly[str, str] = field(default_factory=dict)
    # language → channel or site → words; `names` is the fallback
    translated_names: ReadOnly[str, ReadOnly[str, str]] = field(default_factory=dict)
    thresholds: ReadOnly[str, ReadOnly[str, Threshold]] = field(default_factory=dict)
    tolerances: ReadOnly[str, float] = field(default_factory=dict)
    severities: ReadOnly[str, ReadOnly[str, Severity]] = field(default_factory=dict)
    units: ReadOnly[str, ReadOnly[str, str]] = field(default_factory=dict)
    # field → bit → language → sentence
    sentences: ReadOnly[str, ReadOnly[str, ReadOnly[str, Sentence]]] = field(default_factory=dict)
    balance: BalanceRule = field(default_factory=BalanceRule)

    def find_unit(self, field_name: str, label: str) -> str | None:
        """The unit of a channel if it differs from its field's unit, else None."""
        return self.units.get(field_name, {}).get(label)

    def find_threshold(self, field_name: str, label: str) -> Threshold | None:
        """The limits of a channel, else those of `*` in its field, else None."""
        of_field = self.thresholds.get(field_name, {})
        return of_field.get(label) or of_field.get(ANY)

    def find_tolerance(self, channel: str) -> float | None:
        """Return how far ref and pos may differ before it is shown (rad or m), or None."""
        return self.tolerances.get(channel, self.tolerances.get(ANY))

    def find_severity(self, field_name: str, bit: str) -> Severity:
        """The severity of a bit. An unclassified bit counts as a fault: a false alarm is better than a hidden
        one."""
        return self.severities.get(field_name, {}).get(bit, "fault")


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


def parse_mapping(value: object) -> Mapping:
    """Parse a schema's `mapping` member, already decoded from JSON. Raises SchemaError, which says what is
    wrong and where."""
    doc = check_table(value, "mapping")

    def part(name: str) -> Iterator[tuple[str, object, str]]:
        return check_entries(doc.get(name), f"mapping.{name}")

    return Mapping(
        joints={k: _joint(v, at) for k, v, at in part("joints")},
        sensors={k: _sensor(v, at, k) for k, v, at in part("sensors")},
        names={k: check_text(v, at) for k, v, at in part("names")},
        translated_names={k: _each(v, at, check_text) for k, v, at in part("translated_names")},
        thresholds={k: _each(v, at, _threshold) for k, v, at in part("thresholds")},
        tolerances={k: _at_least_zero(v, at) for k, v, at in part("tolerance")},
        severities={k: _each(v, at, _severity) for k, v, at in part("severity")},
        units={k: _each(v, at, check_text) for k, v, at in part("units")},
        sentences=_sentences(part("explain")),
        balance=_balance(doc.get("balance"), "mapping.balance"),
    )


def _each(value: object, where: str, read: Callable[[object, str], T]) -> dict[str, T]:
    return {name: read(found, at) for name, found, at in check_entries(value, where)}


def _joint(value: object, where: str) -> JointMap:
    doc = check_table(value, where)
    terms: list[tuple[str, float]] = []
    for i, item in enumerate(check_list(doc.get("terms"), f"{where}.terms")):
        at = f"{where}.terms[{i}]"
        pair = check_list(item, at)
        if len(pair) != 2:
            fail(at, "must be [channel, gain]")
        terms.append((check_text(pair[0], f"{at}[0]"), check_number(pair[1], f"{at}[1]")))
    return JointMap(tuple(terms), check_number(doc.get("offset", 0.0), f"{where}.offset"))


def _sensor(value: object, where: str, site: str) -> SensorMount:
    doc = check_table(value, where)
    kind = check_text(doc.get("kind"), f"{where}.kind")
    if kind not in SENSOR_KINDS:
        fail(f"{where}.kind", f"'{kind}' is none of {', '.join(SENSOR_KINDS)}")
    link = doc.get("link")
    return SensorMount(
        kind=kind,
        name=check_text(doc.get("name", site), f"{where}.name"),
        link=None if link is None else check_text(link, f"{where}.link"),
        xyz=_xyz(doc.get("xyz", [0, 0, 0]), f"{where}.xyz"),
        rpy=_xyz(doc.get("rpy", [0, 0, 0]), f"{where}.rpy"),
    )


def _xyz(value: object, where: str) -> Xyz:
    found = check_list(value, where)
    if len(found) != 3:
        fail(where, "must be three numbers")
    x, y, z = (check_number(v, f"{where}[{i}]") for i, v in enumerate(found))
    return (x, y, z)


def _threshold(value: object, where: str) -> Threshold:
    doc = check_table(value, where)
    low, high = (
        None if doc.get(k) is None else check_number(doc[k], f"{where}.{k}") for k in ("low", "high")
    )
    caution = check_number(doc.get("caution", 1.0), f"{where}.caution")
    if not 0 < caution <= 1:
        fail(f"{where}.caution", "must lie above 0 and not above 1")
    if low is not None and high is not None and low >= high:
        fail(where, "low must lie below high")
    return Threshold(low, high, caution)


def _balance(value: object, where: str) -> BalanceRule:
    doc = check_table(value, where)
    feet, ground = doc.get("feet"), doc.get("ground")
    names = None if feet is None else check_texts(feet, f"{where}.feet", FEET_MAX)
    if ground is not None and ground not in GROUNDS:
        fail(f"{where}.ground", f"must be one of {', '.join(GROUNDS)}")
    if len(check_table(doc.get("soles"), f"{where}.soles")) > FEET_MAX:
        fail(f"{where}.soles", f"more than {FEET_MAX} soles")
    soles = {
        foot: _sole(points, at) for foot, points, at in check_entries(doc.get("soles"), f"{where}.soles")
    }
    return BalanceRule(names, cast("Ground | None", ground), soles)


def _sole(value: object, where: str) -> tuple[Xyz, ...]:
    corners = check_list(value, where)
    if not 3 <= len(corners) <= CORNERS_MAX:
        fail(where, f"must have 3 to {CORNERS_MAX} corners")
    return tuple(_xyz(corner, f"{where}[{i}]") for i, corner in enumerate(corners))


def _at_least_zero(value: object, where: str) -> float:
    found = check_number(value, where)
    if found < 0:
        fail(where, "must not be negative")
    return found


def _sentences(entries: Iterator[tuple[str, object, str]]) -> dict[str, dict[str, dict[str, Sentence]]]:
    found = {name: _each(bits, at, _by_language) for name, bits, at in entries}
    sentences = (s for bits in found.values() for by_language in bits.values() for s in by_language.values())
    if sum(len(s.say.encode()) + len((s.why or "").encode()) for s in sentences) > SENTENCES_BYTES_MAX:
        fail("mapping.explain", f"more than {SENTENCES_BYTES_MAX} bytes of sentences in all")
    return found


def _by_language(value: object, where: str) -> dict[str, Sentence]:
    if len(check_table(value, where)) > LANGUAGES_MAX:
        fail(where, f"more than {LANGUAGES_MAX} languages")
    return _each(value, where, _sentence)


def _sentence(value: object, where: str) -> Sentence:
    doc = check_table(value, where)
    why = doc.get("why")
    return Sentence(
        check_text(doc.get("say"), f"{where}.say"), None if why is None else check_text(why, f"{where}.why")
    )


def _severity(value: object, where: str) -> Severity:
    if value not in SEVERITIES:
        fail(where, f"must be one of {', '.join(SEVERITIES)}")
    return cast(Severity, value)


def compute_joint_values(schema: Schema, codes: Sequence[int], field_name: str) -> dict[str, float]:
    """Compute URDF joint → position (rad or m) from one field (`pos` or `ref`) of a frame's codes.

    NaN where a term has no reading or its channel is not in the field; {} when the schema lacks the field. A
    channel of the label set `joint` that no entry uses moves the joint of its own name.
    """
    found = schema.find_field(field_name)
    if found is None:
        return {}
    values = dict(zip(found.labels, found.values(codes), strict=True))
    result: dict[str, float] = {}
    if found.label_set == JOINT:
        result = {label: math.nan if v is None else v for label, v in values.items()}
    for joint, how in schema.mapping.joints.items():
        total = how.offset
        for channel, gain in how.terms:
            v = values.get(channel)
            total += math.nan if v is None else gain * v
        result[joint] = total
    return result


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
