"""Checks the profile, the model and a source's data against each other. Does no I/O.

model/doctor/ checks the model alone; this module finds problems that only live data reveals.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from posecast_wire.schema import JOINT, JointMap

from posecast_edge.cli.source_stats import POSITION, WAIT_S, ChannelStats, SourceStats
from posecast_edge.kit import many
from posecast_edge.model.finding import Finding, quote_name, quote_names, sort_by_severity
from posecast_edge.model.urdf.types import SCALAR_TYPES, Joint, Urdf
from posecast_edge.profile.defaults import guess_unit
from posecast_edge.profile.types import FieldSpec, Profile

SLACK = 0.02  # rad or m past a limit that is not reported: encoders and servos overshoot
GAP_S = 0.5
CLOCK_OFF = 0.05  # of a second per second
CLOCKS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}


def examine_source(seen: SourceStats, urdf: Urdf | None, hz: float, given: bool = True) -> list[Finding]:
    """All findings, worst first. `hz`: the requested frame rate; `given`: the user gave the profile, so it
    was not inferred from the first sample."""
    profile = seen.profile
    if not seen.samples:
        return [Finding("error", "source-silent", f"no sample within {WAIT_S:g} s")]
    if profile is None:
        return [Finding("error", "no-channels", "its samples name no channels: give a --profile")]
    found = [*_clock(seen), *_rate(seen, hz), *_units(seen, profile, urdf)]
    if given:
        found += _fields(seen, profile)
    found += _sensors(seen, profile)
    if urdf is not None:
        found += _joints(seen, profile, urdf)
    return sort_by_severity(found)


# --- time


def _clock(seen: SourceStats) -> Iterator[Finding]:
    if seen.steps_back:
        yield Finding("warning", "clock-back", f"robot time stepped back {_times(seen.steps_back)}")
        return
    if seen.samples < 2 or seen.duration_s <= 0:
        return
    pace = (seen.times_s[1] - seen.times_s[0]) / seen.duration_s
    unit = next((word for factor, word in CLOCKS.items() if 0.5 < pace / factor < 2), None)
    if unit:
        text = f"robot time runs {pace:.3g} s a second: are these {unit}?"
        yield Finding("error", "clock-unit", text)
    elif pace == 0:
        text = f"robot time stays at {seen.times_s[0]:.3f} s while samples arrive"
        yield Finding("error", "clock-stands", text)
    elif abs(pace - 1) > CLOCK_OFF:
        text = f"robot time runs {pace:.3g} s a second: a replay, a simulator or a wrong clock"
        yield Finding("warning", "clock-pace", text)


def _rate(seen: SourceStats, hz: float) -> Iterator[Finding]:
    if seen.samples < 3:
        yield Finding("warning", "rate-few", f"only {many(seen.samples, 'sample')} arrived")
    elif seen.rate_hz < 0.9 * hz:
        text = f"the source delivers {seen.rate_hz:.3g} samples a second; --hz asks for {hz:g}"
        yield Finding("hint", "rate-low", text)
    if seen.longest_gap_s > GAP_S:
        text = f"no sample for {seen.longest_gap_s:.1f} s: pages show STALE after 1.5 s"
        yield Finding("warning", "rate-gap", text)


# --- channels


def _units(seen: SourceStats, profile: Profile, urdf: Urdf | None) -> Iterator[Finding]:
    for name, channels in seen.fields.items():
        spec = profile.find_field(name)
        if spec is None or spec.bits:
            continue
        by_doubt: dict[str, list[str]] = {}
        for label in _doubted(name, channels, profile, urdf):
            by_doubt.setdefault(guess_unit(name, channels[label].largest) or "", []).append(label)
        for doubt, labels in by_doubt.items():
            most = max(channels[label].largest for label in labels)
            text = f"{name} of {quote_names(labels)} reaches {most:.4g} {spec.unit}: are these {doubt}?"
            yield Finding("error", "unit", text)
    norms = seen.quaternions
    if norms.readings and (norms.low < 0.9 or norms.high > 1.1):
        text = f"a quaternion has length {norms.low:.3g} … {norms.high:.3g}, not 1"
        yield Finding("warning", "quaternion", text)


def _doubted(
    name: str, channels: Mapping[str, ChannelStats], profile: Profile, urdf: Urdf | None
) -> list[str]:
    """Channels whose values can't be in their field's unit. Skips sliding joints and channels with their own
    unit."""
    apart = set(profile.mapping.units.get(name, {}))
    if name in POSITION and urdf is not None:
        maps = profile.mapping.joints
        sliding = {j.name for j in urdf.joints if j.type == "prismatic"}
        apart |= sliding | {c for joint in sliding & set(maps) for c, _ in maps[joint].terms}
    return [label for label, c in channels.items() if label not in apart and guess_unit(name, c.largest)]


def _fields(seen: SourceStats, profile: Profile) -> Iterator[Finding]:
    for name in seen.fields:
        if profile.find_field(name) is None:
            yield Finding("hint", "field-unused", f"the source has {quote_name(name)}, the profile does not")
    for spec in profile.fields:
        if spec.name in seen.wrong_lengths:
            given = seen.wrong_lengths[spec.name]
            text = f"{spec.name} has {many(given, 'value')}, but the profile has {len(spec.labels)} labels"
            yield Finding("error", "field-length", text)
            continue
        channels = seen.fields.get(spec.name)
        if channels is None:
            yield Finding(
                "warning", "field-missing", f"the profile has {quote_name(spec.name)}, the source does not"
            )
            continue
        unknown = [label for label in channels if label not in spec.labels]
        if unknown:
            text = f"{spec.name} has {quote_names(unknown)}, which the profile does not name"
            yield Finding("warning", "channel-unknown", text)
        yield from _bits(spec, channels)


def _bits(spec: FieldSpec, channels: dict[str, ChannelStats]) -> Iterator[Finding]:
    if not spec.bits:
        return
    seen_bits = sorted(set().union(*(c.bits for c in channels.values())) - set(spec.bits))
    if seen_bits:
        text = f"{spec.name} has bits the profile does not name: {quote_names(seen_bits)}"
        yield Finding("warning", "bit-unknown", text)
    largest = max((c.largest for c in channels.values()), default=0.0)
    if largest >= 1 << len(spec.bits):
        text = f"{spec.name} has masks up to {largest:.0f}, the profile names {len(spec.bits)} bits"
        yield Finding("warning", "bit-unknown", text)


def _sensors(seen: SourceStats, profile: Profile) -> Iterator[Finding]:
    sites = dict.fromkeys(
        label.partition(".")[0]
        for spec in profile.fields
        if spec.label_set != JOINT and spec.name in ("ftm", "ftf", "quat", "gyro", "acc", "tilt")
        for label in spec.labels
    )
    mounts = profile.mapping.sensors
    loose = [s for s in sites if s not in mounts or (mounts[s].link is None and mounts[s].kind != "power")]
    if loose:
        text = f"{_the('sensor', loose)} without a link in [sensors]: the page can't place the readings"
        yield Finding("warning", "sensor-link", text)
    silent = [
        site
        for site in mounts
        if site in sites
        and not any(
            c.readings
            for channels in seen.fields.values()
            for label, c in channels.items()
            if label.partition(".")[0] == site
        )
    ]
    if silent:
        yield Finding("warning", "sensor-silent", f"no reading from {_the('sensor', silent)}")


# --- joints of the model


def _joints(seen: SourceStats, profile: Profile, urdf: Urdf) -> Iterator[Finding]:
    moving = {j.name: j for j in urdf.joints if j.type in SCALAR_TYPES}
    spec = next((f for n in POSITION if (f := profile.find_field(n)) and n in seen.fields), None)
    if spec is None or spec.label_set != JOINT:
        yield Finding("error", "no-positions", "no pos and no ref for any joint: the body can't move")
        return
    labels, maps, channels = spec.labels, profile.mapping.joints, seen.fields[spec.name]

    def reads(channel: str) -> bool:
        return channel in channels and channels[channel].readings > 0

    undriven = [n for n, j in moving.items() if n not in maps and n not in labels and j.mimic is None]
    if undriven:
        yield Finding("warning", "joint-undriven", f"no channel moves the model's {_the('joint', undriven)}")
    used = {channel for how in maps.values() for channel, _ in how.terms}
    useless = [x for x in labels if x not in used and x not in moving]
    heard = [x for x in useless if reads(x)]
    if heard:
        text = f"{_the('channel', heard)} moves nothing: the model has no such joint"
        yield Finding("warning", "channel-moves-nothing", text)
    dead = [x for x in labels if not reads(x) and (x in used or x in moving)]
    if dead:
        text = f"no reading for {spec.name} of {quote_names(dead)}: that part of the body stays still"
        yield Finding("warning", "channel-dead", text)
    yield from _couplings(maps, labels, moving, dead)
    doubted = set(_doubted(spec.name, channels, profile, urdf))
    for name, joint in moving.items():
        how = maps.get(name, JointMap(((name, 1.0),)) if name in labels else None)
        where = seen.joints.get(name)
        if how is not None and where is not None and not any(c in doubted for c, _ in how.terms):
            yield from _within(joint, how, where, channels)


def _couplings(
    maps: Mapping[str, JointMap], labels: Sequence[str], moving: Mapping[str, Joint], dead: Sequence[str]
) -> Iterator[Finding]:
    for name, how in maps.items():
        missing = [c for c, _ in how.terms if c in dead]
        if len(how.terms) > 1 and missing:
            needs = quote_names([c for c, _ in how.terms])
            text = f"joint {quote_name(name)} needs {needs}; no reading for {quote_names(missing)}"
            yield Finding("warning", "coupling-dead", text)
        for channel, gain in how.terms:
            if gain == 0:
                text = f"joint {quote_name(name)} multiplies channel {quote_name(channel)} by 0"
                yield Finding("warning", "coupling-zero", text)
            if (
                name in moving
                and channel != name
                and channel in moving
                and channel in labels
                and channel not in maps
            ):
                quoted = quote_name(channel)
                text = f"channel {quoted} moves two joints, {quoted} and {quote_name(name)}"
                yield Finding("warning", "coupling-shared", text)
        joint = moving.get(name)
        if joint is not None and joint.mimic is not None:
            text = f"joint {quote_name(name)} mimics another in the model; the profile overrides that"
            yield Finding("hint", "coupling-mimic", text)


def _within(
    joint: Joint, how: JointMap, where: ChannelStats, channels: dict[str, ChannelStats]
) -> Iterator[Finding]:
    limit = joint.limit
    if not where.readings or limit is None or joint.type == "continuous":
        return
    low, high = limit.lower or 0.0, limit.upper or 0.0
    if low >= high or (where.low >= low - SLACK and where.high <= high + SLACK):
        return
    unit = "m" if joint.type == "prismatic" else "rad"
    shown = f"moves from {where.low:.3g} to {where.high:.3g} {unit}; its limits are {low:.3g} to {high:.3g}"
    factor, instead = (1e-3, "millimetres") if joint.type == "prismatic" else (math.pi / 180, "degrees")
    if len(how.terms) > 1:
        from_what = ", ".join(f"{c} {channels[c].largest:.3g}" for c, _ in how.terms if c in channels)
        text = f"joint {quote_name(joint.name)} {shown}: is the coupling right for {from_what}?"
        yield Finding("warning", "coupling-limit", text, joint.line)
    elif _fits(where, factor, low, high) and where.largest > 3 * max(abs(low), abs(high), 0.1):
        yield Finding(
            "error", "unit", f"joint {quote_name(joint.name)} {shown}: are these {instead}?", joint.line
        )
    else:
        yield Finding("warning", "limit-exceeded", f"joint {quote_name(joint.name)} {shown}", joint.line)


def _fits(where: ChannelStats, factor: float, low: float, high: float) -> bool:
    return where.low * factor >= low - SLACK and where.high * factor <= high + SLACK


def _the(what: str, names: Sequence[str]) -> str:
    return f"{what}{'s' if len(names) > 1 else ''} {quote_names(names)}"


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"
