"""Resolves a profile's [joints] to channels. Does no I/O.

A term names a channel or, if there is no such channel, another entry of [joints]: `knuckle2` may follow
`knuckle1`, like a mimic joint of a URDF. Schemas contain only channels, so such terms are replaced by the
terms of the entry they name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from posecast_wire.schema import JointMap

DEPTH_MAX = 32  # length of a chain of joints that follow one another
TERMS_MAX = 1 << 16  # of all joints, once resolved to channels


class TermError(ValueError):
    """An invalid entry. `joint`: the entry's name; `term`: index of the wrong term, None for the whole
    entry."""

    def __init__(self, joint: str, term: int | None, reason: str) -> None:
        super().__init__(reason)
        self.joint = joint
        self.term = term
        self.reason = reason


def resolve_entries(entries: Mapping[str, JointMap], channels: Sequence[str]) -> dict[str, JointMap]:
    """Express every entry in terms of channels, keeping the order.

    Raises TermError for an unknown name, a cycle, two joints that use one channel, or entries beyond the
    bounds above.
    """
    known = frozenset(channels)
    owners: dict[str, str] = {}
    for joint, entry in entries.items():
        for i, (name, _) in enumerate(entry.terms):
            if name not in known and name not in entries:
                raise TermError(joint, i, f"unknown joint {name!r}")
        if len(entry.terms) == 1 and entry.terms[0][0] in known:
            channel = entry.terms[0][0]
            if channel in owners:
                reason = (
                    f"channel {channel!r} already moves joint {owners[channel]!r}; "
                    f"for a joint that moves with it, use {owners[channel]!r} as the term"
                )
                raise TermError(joint, 0, reason)
            owners[channel] = joint
    resolved: dict[str, JointMap] = {}
    terms = 0
    for joint in entries:
        terms += len(_resolve(joint, entries, known, resolved, ()).terms)
        if terms > TERMS_MAX:
            raise TermError(joint, None, f"all joints together have more than {TERMS_MAX} terms")
    return {joint: resolved[joint] for joint in entries}


def _resolve(
    joint: str,
    entries: Mapping[str, JointMap],
    channels: frozenset[str],
    resolved: dict[str, JointMap],
    above: tuple[str, ...],
) -> JointMap:
    if joint in resolved:
        return resolved[joint]
    if joint in above:
        loop = " → ".join((*above[above.index(joint) :], joint))
        raise TermError(joint, None, f"a loop: {loop}")
    if len(above) > DEPTH_MAX:
        raise TermError(above[0], None, f"a chain of more than {DEPTH_MAX} joints that follow one another")
    gains: dict[str, float] = {}
    offset = entries[joint].offset
    for name, gain in entries[joint].terms:
        if name in channels:
            gains[name] = gains.get(name, 0.0) + gain
            continue
        other = _resolve(name, entries, channels, resolved, (*above, joint))
        offset += gain * other.offset
        for channel, other_gain in other.terms:
            gains[channel] = gains.get(channel, 0.0) + gain * other_gain
    resolved[joint] = JointMap(tuple(gains.items()), offset)
    return resolved[joint]
