"""Reads a profile's [views] table: which part of the robot each audience receives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from posecast_wire.keys import check_name

from posecast_edge.profile.types import FieldSpec, View

if TYPE_CHECKING:
    from posecast_edge.profile.reader import ProfileReader

VIEWS_MAX = 8  # a relay accepts no more per robot
HZ_MIN = 0.1  # as on the wire


def read_view(reader: ProfileReader, name: str, value: object, fields: Mapping[str, FieldSpec]) -> View:
    """Parse the table of one view. Raises ProfileError, which names the line."""
    where = f"views.{name}"
    try:
        check_name("view", name)
    except ValueError as e:
        reader.fail(where, str(e))
    item = reader.check_table(value, where, ("fields", "hz", "scales", "info"))
    seen = reader.check_unique_texts(item.get("fields", list(fields)), f"{where}.fields")
    for i, field_name in enumerate(seen):
        reader.check_choice(field_name, fields, "field", f"{where}.fields[{i}]")
    known = frozenset(seen)
    scales = {
        reader.check_choice(k, known, "field of this view", f"{where}.scales.{k}"): reader.check_number(
            v, f"{where}.scales.{k}", above=0
        )
        for k, v in reader.check_table(item.get("scales", {}), f"{where}.scales").items()
    }
    for k in scales:
        if fields[k].bits:
            reader.fail(f"{where}.scales.{k}", "a field of bits has no scale")
    hz = reader.check_number(item["hz"], f"{where}.hz", low=HZ_MIN) if "hz" in item else None
    return View(seen, hz, scales, _info(reader, item, where))


def _info(reader: ProfileReader, item: Mapping[str, object], where: str) -> tuple[str, ...] | None:
    """The texts of a view. A view that lists fields must list its texts too, so that a source's texts (a
    diagnosis, an operator's name) are never shown by accident.
    """
    if "info" not in item:
        return () if "fields" in item else None
    return () if item["info"] == [] else reader.check_unique_texts(item["info"], f"{where}.info")
