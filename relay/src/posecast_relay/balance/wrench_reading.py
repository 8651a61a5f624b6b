"""Reads force-torque sensors that are mounted on a link, in SI units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from posecast_wire import CODE_MAX, Schema
from posecast_wire.mapping import JOINT, Xyz

from posecast_relay.kinematics.channel_places import ChannelPlaces
from posecast_relay.unit_conversion import Quantity, find_factor

AXES: tuple[Xyz, Xyz, Xyz] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
AxisChannel = tuple[int, int, float]  # axis (0 x, 1 y, 2 z), place in the code vector, factor to SI


class Wrench(NamedTuple):
    """A force (N) and the moment about the sensor's origin (N·m), in the sensor's axes; None without a
    reading of all axes that are measured; one at the limit of its code is none. An axis that is not measured
    is 0."""

    force: Xyz | None
    moment: Xyz | None


class WrenchSensor:
    """One sensor's channels in the frames of a schema."""

    def __init__(self, schema: Schema, places: ChannelPlaces, site: str) -> None:
        self._force = _find_axes(schema, places, "ftf", site, ("fx", "fy", "fz"), "force")
        self._moment = _find_axes(schema, places, "ftm", site, ("mx", "my", "mz"), "torque")
        self.force_axes = frozenset(axis for axis, _, _ in self._force)
        self.moment_axes = frozenset(axis for axis, _, _ in self._moment)

    def read(self, codes: Sequence[int]) -> Wrench:
        """The wrench of a frame."""
        return Wrench(_read_axes(codes, self._force), _read_axes(codes, self._moment))


def _find_axes(
    schema: Schema, places: ChannelPlaces, name: str, site: str, parts: Sequence[str], quantity: Quantity
) -> tuple[AxisChannel, ...]:
    field = schema.find_field(name)
    if field is None or field.bits or field.label_set == JOINT:
        return ()
    found: list[AxisChannel] = []
    for axis, part in enumerate(parts):
        label = f"{site}.{part}"
        place = places.find(name, label)
        factor = find_factor(quantity, schema.mapping.find_unit(name, label) or field.unit)
        if place is not None and factor is not None:  # in another unit nobody knows how much it is
            found.append((axis, place, factor * field.scale))
    return tuple(found)


def _read_axes(codes: Sequence[int], channels: Sequence[AxisChannel]) -> Xyz | None:
    if not channels:
        return None
    values = [0.0, 0.0, 0.0]
    for axis, place, factor in channels:
        if abs(codes[place]) >= CODE_MAX:  # none, or more than the code can say
            return None
        values[axis] = codes[place] * factor
    return (values[0], values[1], values[2])
