"""Reads sensors whose parts a program gives as a list: `{"wrist": [1, 2, 3]}` as `{"wrist.fx": 1, …}`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import cast

from posecast_edge.kit import quote
from posecast_edge.sample import WORDS

# field of a sensor → the parts of its list
PARTS = {
    "ftf": ("fx", "fy", "fz"),
    "ftm": ("mx", "my", "mz"),
    "quat": ("x", "y", "z", "w"),
    "gyro": ("x", "y", "z"),
    "acc": ("x", "y", "z"),
}


def has_lists(name: str, values: Mapping[str, object]) -> bool:
    """Whether the field is that of a sensor, and any of its values is a list or an array."""
    return name in PARTS and any(hasattr(value, "__len__") for value in values.values())


def split_lists(
    name: str, values: Mapping[str, object], report: Callable[[str, str], None]
) -> dict[str, object]:
    """The values by label. `report` is called with the site and a line for a list of another length, which is
    left out."""
    parts = PARTS[name]
    found: dict[str, object] = {}
    for site, value in values.items():
        numbers = cast("Sequence[object]", value)
        if not hasattr(value, "__len__") or isinstance(value, (Mapping, *WORDS)):
            found[site] = value
        elif len(numbers) != len(parts):
            report(site, f"{name} of {quote(site)}: give {len(parts)} numbers, {', '.join(parts)}")
        else:
            found |= zip((f"{site}.{part}" for part in parts), numbers, strict=False)
    return found
