"""Makes the schema from the profile and, without a profile, infers one from a sample's fields and labels."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from posecast_wire.checked import is_text
from posecast_wire.schema import (
    BITS_MAX,
    JOINT,
    BalanceRule,
    SensorMount,
    Sentence,
    Threshold,
    build_schema_text,
)
from posecast_wire.schema import Mapping as Meaning

from posecast_edge.profile.defaults import (
    DIAG_BITS,
    FLAG_BITS,
    PLAIN,
    SITES_OF,
    SLIDING,
    STATE_BITS,
    WELL_KNOWN,
)
from posecast_edge.profile.types import FieldSpec, Profile
from posecast_edge.sample import Reading, Sample, SourceError, Values

FLAGS, DIAG = "flags", "diag"
MASKS = range(1 << BITS_MAX)
POSITIONS = ("ref", "pos")
# ends of the names of a floating joint's readings
TRANSLATION = tuple(f"/trans_{c}" for c in "xyz")
ROTATION = tuple(f"/rot_{c}" for c in "xyzw")
NO_UNIT = "1"
MASK_BITS = {f"bit{i}": 1 << i for i in range(BITS_MAX)}  # the bits of a mask have no names of their own


def make_schema_text(profile: Profile) -> str:
    """The schema as JSON text. Raises posecast_wire.SchemaError when the wire format cannot express the
    profile."""
    used = dict.fromkeys(f.label_set for f in profile.fields)
    fields = [
        {
            "name": f.name,
            "labels": f.label_set,
            "unit": f.unit,
            "scale": f.scale,
            "rel": f.rel,
            "bits": f.bits,
            "slow": f.slow,
        }
        for f in profile.fields
    ]
    labels = {name: profile.labels[name] for name in used}
    return build_schema_text(profile.name, labels, fields, _mapping(profile.mapping))


def _mapping(meaning: Meaning) -> dict[str, object]:
    """The `mapping` member, without empty parts."""
    parts: dict[str, object] = {
        "joints": {
            name: {"terms": [list(term) for term in joint.terms], "offset": joint.offset}
            for name, joint in meaning.joints.items()
        },
        "sensors": {
            site: {"kind": s.kind, "name": s.name, "link": s.link, "xyz": list(s.xyz), "rpy": list(s.rpy)}
            for site, s in meaning.sensors.items()
        },
        "names": dict(meaning.names),
        "translated_names": {language: dict(names) for language, names in meaning.translated_names.items()},
        "thresholds": {
            field: {label: _threshold(t) for label, t in limits.items()}
            for field, limits in meaning.thresholds.items()
        },
        "tolerance": dict(meaning.tolerances),
        "severity": {field: dict(bits) for field, bits in meaning.severities.items()},
        "units": {field: dict(labels) for field, labels in meaning.units.items()},
        "explain": {
            field: {
                bit: {language: _sentence(s) for language, s in by_language.items()}
                for bit, by_language in bits.items()
            }
            for field, bits in meaning.sentences.items()
        },
    }
    parts["balance"] = _balance(meaning.balance)
    return {name: part for name, part in parts.items() if part}


def _balance(rule: BalanceRule) -> dict[str, object]:
    return {
        **({"feet": list(rule.feet)} if rule.feet is not None else {}),
        **({"ground": rule.ground} if rule.ground is not None else {}),
        **(
            {"soles": {foot: [list(c) for c in sole] for foot, sole in rule.soles.items()}}
            if rule.soles
            else {}
        ),
    }


def _sentence(s: Sentence) -> dict[str, str]:
    return {"say": s.say} if s.why is None else {"say": s.say, "why": s.why}


def _threshold(t: Threshold) -> dict[str, float]:
    limits = {"low": t.low, "high": t.high, "caution": t.caution}
    return {k: v for k, v in limits.items() if v is not None}


def infer_profile(robot: str, sample: Sample, sliding: Collection[str] = ()) -> Profile:
    """Infer a profile from a sample's fields and labels, with units and scales of well-known field names. A
    field without labels is left out, unless it has a value for each joint.

    `sliding`: joints that slide according to the robot's model, in addition to those in the sample.

    Raises SourceError when the sample names no channel.
    """
    joints = _joint_labels(sample)
    labels: dict[str, tuple[str, ...]] = {}
    sets: dict[tuple[str, ...], str] = {}  # the label sets in `labels`, by content
    fields: dict[str, FieldSpec] = {}
    # in the well-known order, so that ref comes before pos, which is relative to it
    names = [n for n in WELL_KNOWN if n in sample.values] + [n for n in sample.values if n not in WELL_KNOWN]
    for name in names:
        values = sample.values[name]
        default = WELL_KNOWN.get(name, PLAIN)
        own = joints if default.joints else tuple(values) if isinstance(values, Mapping) else ()
        if not own or not (isinstance(values, Mapping) or len(values) == len(own)):
            continue
        label_set = JOINT if default.joints else sets.get(own, name)
        labels[label_set] = own
        sets.setdefault(own, label_set)
        bits = _flag_bits(values) if name == FLAGS else DIAG_BITS if name == DIAG else ()
        rel = default.rel if default.rel in fields else None
        scale = 1.0 if bits else default.scale
        fields[name] = FieldSpec(name, label_set, own, default.unit, scale, rel=rel, bits=bits)
    if not fields:
        raise SourceError("it names no channel")
    severities = {
        f.name: states
        for f in fields.values()
        if (states := {bit: STATE_BITS[bit] for bit in f.bits if bit in STATE_BITS})
    }
    meaning = Meaning(sensors=_mounts(sample), severities=severities)
    profile = Profile(robot, tuple(fields.values()), labels, meaning)
    return mark_sliding(profile, {*sample.sliding, *sliding})


def mark_sliding(profile: Profile, sliding: Collection[str]) -> Profile:
    """The profile with metres, m/s and N for the joints in `sliding`, in finer steps than angles need.

    So also for the translation of floating joints; the quaternion of these has no unit. A field has one step
    for all channels, so it gets the finer one; its angles keep their coarser step as a multiple of it.
    """
    fields: list[FieldSpec] = []
    units = {name: dict(labels) for name, labels in profile.mapping.units.items()}
    for f in profile.fields:
        slide = SLIDING.get(f.name)
        found = [label for label in f.labels if label in sliding or label.endswith(TRANSLATION)]
        turns = [label for label in f.labels if f.name in POSITIONS and label.endswith(ROTATION)]
        if slide is None or f.label_set != JOINT or not (found or turns):
            fields.append(f)
            continue
        if len(found) == len(f.labels):
            fields.append(replace(f, unit=slide.unit, scale=slide.scale))
            continue
        own = dict.fromkeys(found, slide.unit) | dict.fromkeys(turns, NO_UNIT)
        units.setdefault(f.name, {}).update(own)
        stride = max(1, round(f.scale / slide.scale))
        strides = {label: stride for label in f.labels if label not in own} if stride > 1 else {}
        fields.append(replace(f, scale=min(f.scale, slide.scale), strides={**f.strides, **strides}))
    return replace(profile, fields=tuple(fields), mapping=replace(profile.mapping, units=units))


def _mounts(sample: Sample) -> dict[str, SensorMount]:
    """The sites whose link is in the sample."""
    kinds = {
        label.partition(".")[0]: kind
        for name, kind in SITES_OF.items()
        if isinstance(values := sample.values.get(name), Mapping)
        for label in values
    }
    return {
        site: SensorMount(kinds[site], site, link)
        for site, link in sample.links.items()
        if site in kinds and is_text(site) and is_text(link)
    }


def _joint_labels(sample: Sample) -> tuple[str, ...]:
    """Every joint that any of the joint fields names, in the order of first appearance."""
    found: dict[str, None] = {}
    for name, values in sample.values.items():
        if isinstance(values, Mapping) and name in WELL_KNOWN and WELL_KNOWN[name].joints:
            found.update(dict.fromkeys(values))
    return tuple(found)


def list_bits(reading: object, most: int = BITS_MAX) -> Iterator[str]:
    """The names in a list of bits, of the first `most` items, or the MASK_BITS that a mask has set."""
    if isinstance(reading, (list, tuple)):
        yield from (bit for bit in reading[:most] if isinstance(bit, str))
    elif type(reading) is int and reading in MASKS:
        yield from (name for name, bit in MASK_BITS.items() if reading & bit)


def _flag_bits(values: Values) -> tuple[str, ...]:
    """All bits that the flags name, and the usual ones as far as there is room: then a fault that appears
    needs no new schema."""
    readings: Sequence[Reading] = list(values.values() if isinstance(values, Mapping) else values)
    own = dict.fromkeys(bit for reading in readings for bit in list_bits(reading, BITS_MAX))
    usual = MASK_BITS if own and own.keys() <= MASK_BITS.keys() else FLAG_BITS
    room = BITS_MAX - len(own)
    spare = [bit for bit in usual if bit not in own][: max(room, 0)]
    return tuple(dict.fromkeys((*(bit for bit in usual if bit in own or bit in spare), *own)))[:BITS_MAX]
