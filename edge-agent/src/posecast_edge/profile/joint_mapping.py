"""What moves which joint: a profile's [joints] resolved down to channels. Pure.

A term names a channel or, where there is no such channel, another entry of [joints]: `knuckle2` may follow
`knuckle1`, as a mimic joint of a URDF does. The wire knows channels only, so such terms are replaced here by
what they stand for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from posecast_wire.mapping import JointMap

DEPTH_MAX = 32  # joints that follow one another
TERMS_MAX = 1 << 16  # of all joints, once they stand for channels


class TermError(ValueError):
    """An entry that can't be. `joint`: whose; `term`: which of its terms, None for the whole entry."""

    def __init__(self, joint: str, term: int | None, reason: str) -> None:
        super().__init__(reason)
        self.joint = joint
        self.term = term
        self.reason = reason


def resolve_entries(entries: Mapping[str, JointMap], channels: Sequence[str]) -> dict[str, JointMap]:
    """Every entry in terms of channels, in the order given.

    TermError: an unknown name, a loop, two joints that claim one channel, more than the bounds above.
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
                    f"channel {channel!r} moves joint {owners[channel]!r} already; "
                    f"a joint that moves with it names {owners[channel]!r} as its term"
                )
                raise TermError(joint, 0, reason)
            owners[channel] = joint
    resolved: dict[str, JointMap] = {}
    terms = 0
    for joint in entries:
        terms += len(_resolve(joint, entries, known, resolved, ()).terms)
        if terms > TERMS_MAX:
            raise TermError(
                joint, None, f"more than {TERMS_MAX} channels move joints, counted for each joint"
            )
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
        raise TermError(above[0], None, f"more than {DEPTH_MAX} joints follow one another")
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
