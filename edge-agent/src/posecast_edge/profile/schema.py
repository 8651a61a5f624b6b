"""Makes the schema from the profile and, without a profile, infers one from the first sample."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from posecast_wire.mapping import JOINT, BalanceRule, SensorMount, Sentence, Threshold
from posecast_wire.mapping import Mapping as Meaning
from posecast_wire.schema import BITS_MAX, CHANNELS_MAX, FIELD_NAME, build_schema_text

from posecast_edge.profile.field_defaults import (
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
from posecast_edge.visible import quote

FLAGS, DIAG = "flags", "diag"


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
    """Infer a profile from a robot's first sample: its fields and labels, with units and scales of well-known
    field names. Fields and labels that appear only later are not included.

    `sliding`: joints that slide according to the robot's model, in addition to those in the sample.

    Raises SourceError when the sample is not enough: values without labels, nothing usable, too many
    channels.
    """
    joints = _joint_labels(sample)
    labels: dict[str, tuple[str, ...]] = {}
    sets: dict[tuple[str, ...], str] = {}  # the label sets in `labels`, by content
    fields: dict[str, FieldSpec] = {}
    channels = 0
    # in the well-known order, so that ref comes before pos, which is relative to it
    names = [n for n in WELL_KNOWN if n in sample.values] + [n for n in sample.values if n not in WELL_KNOWN]
    for name in names:
        values = sample.values[name]
        default = WELL_KNOWN.get(name, PLAIN)
        if not FIELD_NAME.fullmatch(name):
            raise SourceError(f"{quote(name)} is not a field name: use letters, digits and _, no digit first")
        if default.joints:
            label_set, own = JOINT, joints
        elif isinstance(values, Mapping):
            own = tuple(values)
            label_set = sets.get(own, name)
        else:
            raise SourceError(_unlabelled(name, values))
        if not own:
            continue
        if not isinstance(values, Mapping) and len(values) != len(own):
            raise SourceError(_unlabelled(name, values))
        channels += len(own)
        if channels > CHANNELS_MAX:
            raise SourceError(f"it names more than {CHANNELS_MAX} channels")
        labels[label_set] = own
        sets.setdefault(own, label_set)
        bits = _flag_bits(values) if name == FLAGS else DIAG_BITS if name == DIAG else ()
        rel = default.rel if default.rel in fields else None
        scale = 1.0 if bits else default.scale
        fields[name] = FieldSpec(name, label_set, own, default.unit, scale, rel=rel, bits=bits)
    if not fields:
        raise SourceError("the first sample names no channel")
    severities = {
        f.name: states
        for f in fields.values()
        if (states := {bit: STATE_BITS[bit] for bit in f.bits if bit in STATE_BITS})
    }
    meaning = Meaning(sensors=_mounts(sample), severities=severities)
    profile = Profile(robot, tuple(fields.values()), labels, meaning)
    return mark_sliding(profile, {*sample.sliding, *sliding})


def join_channels(first: Sample, later: Sample) -> Sample:
    """The first sample plus the fields and channels that only the later one has, to infer a profile from.
    Values and order of the first sample stay."""
    values: dict[str, Values] = dict(first.values)
    for name, new in later.values.items():
        old = values.get(name)
        if old is None:
            values[name] = new
        elif isinstance(old, Mapping) and isinstance(new, Mapping):
            own = {label: reading for label, reading in new.items() if label not in old}
            if name == FLAGS:  # a mask would remove the names of bits that have one
                own = {label: None if isinstance(r, int) else r for label, r in own.items()}
            values[name] = {**old, **own}
    links = {**later.links, **first.links}
    return first._replace(values=values, links=links, sliding=first.sliding | later.sliding)


def mark_sliding(profile: Profile, sliding: Collection[str]) -> Profile:
    """The profile with metres, m/s and N for the joints in `sliding`, in finer steps than angles need.

    A field has one step for all channels, so it gets the finer one; its angles keep their coarser step as a
    multiple of it.
    """
    fields: list[FieldSpec] = []
    units = {name: dict(labels) for name, labels in profile.mapping.units.items()}
    for f in profile.fields:
        slide = SLIDING.get(f.name)
        found = [label for label in f.labels if label in sliding]
        if slide is None or f.label_set != JOINT or not found:
            fields.append(f)
            continue
        if len(found) == len(f.labels):
            fields.append(replace(f, unit=slide.unit, scale=slide.scale))
            continue
        units.setdefault(f.name, {}).update(dict.fromkeys(found, slide.unit))
        stride = max(1, round(f.scale / slide.scale))
        strides = {label: stride for label in f.labels if label not in found} if stride > 1 else {}
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
    return {s: SensorMount(kinds[s], s, link) for s, link in sample.links.items() if s in kinds}


def _joint_labels(sample: Sample) -> tuple[str, ...]:
    """Every joint that any of the joint fields names, in the order of first appearance."""
    found: dict[str, None] = {}
    for name, values in sample.values.items():
        if isinstance(values, Mapping) and name in WELL_KNOWN and WELL_KNOWN[name].joints:
            found.update(dict.fromkeys(values))
    return tuple(found)


def _flag_bits(values: Values) -> tuple[str, ...]:
    readings: Sequence[Reading] = list(values.values() if isinstance(values, Mapping) else values)
    if any(isinstance(r, int) for r in readings):  # a mask without names for its bits
        return tuple(f"bit{i}" for i in range(BITS_MAX))
    named = [bit for r in readings if isinstance(r, (list, tuple)) for bit in r if isinstance(bit, str)]
    return tuple(dict.fromkeys((*FLAG_BITS, *named)))[:BITS_MAX]


def _unlabelled(name: str, values: Values) -> str:
    return f"{name} has {len(values)} values without labels: name them, or give a --profile"
