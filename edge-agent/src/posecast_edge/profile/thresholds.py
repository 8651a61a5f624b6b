"""Reads a profile's [thresholds] table: the limits of channels, and of values that viewers compute."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from posecast_wire.schema import ANY, Threshold

from posecast_edge.profile.types import BALANCE, FieldSpec

if TYPE_CHECKING:
    from posecast_edge.profile.reader import ProfileReader

MARGIN = "margin"  # mm, from the centre of mass to the edge of the support area


def read_thresholds(
    reader: ProfileReader, value: object, fields: Mapping[str, FieldSpec]
) -> dict[str, dict[str, Threshold]]:
    """Parse [thresholds] into field → label → limits. Besides the fields it may have `balance` → `margin`.
    Raises ProfileError, which names the line."""
    thresholds: dict[str, dict[str, Threshold]] = {}
    for name, entry in reader.check_table(value, "thresholds").items():
        where = f"thresholds.{name}"
        own = (MARGIN,) if name == BALANCE else ()
        if own and name not in fields:
            labels = frozenset(own)
        else:
            field = fields[reader.check_choice(name, fields, "field", where)]
            labels = frozenset((*field.labels, ANY, *own))
        thresholds[name] = {
            reader.check_choice(label, labels, "label", f"{where}.{label}"): _limits(
                reader, limits, f"{where}.{label}"
            )
            for label, limits in reader.check_table(entry, where).items()
        }
    return thresholds


def _limits(reader: ProfileReader, value: object, where: str) -> Threshold:
    item = reader.check_table(value, where, ("low", "high", "caution"))
    low, high, caution = (
        reader.check_number(item[k], f"{where}.{k}") if k in item else None
        for k in ("low", "high", "caution")
    )
    if low is None and high is None:
        reader.fail(where, "give low, high or both")
    if low is not None and high is not None and low >= high:
        reader.fail(where, f"low {low:g} is not below high {high:g}")
    if caution is None:
        caution = 1.0
    elif not 0 < caution <= 1:
        reader.fail(f"{where}.caution", f"must be above 0 and at most 1, not {caution:g}")
    return Threshold(low, high, caution)
