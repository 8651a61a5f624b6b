"""Checks values of a model's manifest, because it comes from a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NoReturn

from posecast_wire.checked import make_visible
from posecast_wire.schema import Xyz


class ModelTreeError(ValueError):
    """A part of a manifest that can't be used: one line, `where: reason`."""


def check_table(value: object, where: str) -> Mapping[str, object]:
    """Return `value` if it is an object. Raises ModelTreeError."""
    if not isinstance(value, dict):
        fail(where, "no object")
    return value


def check_list(value: object, where: str, most: int) -> Sequence[object]:
    """Return `value` if it is a list of at most `most`. Raises ModelTreeError."""
    if not isinstance(value, list):
        fail(where, "no list")
    if len(value) > most:
        fail(where, f"{len(value)} are too many")
    return value


def check_name(value: object, where: str) -> str:
    """Return `value` if it is a text. Raises ModelTreeError."""
    if not isinstance(value, str):
        fail(where, "no name")
    return value


def check_number(value: object, where: str) -> float:
    """Return `value` as float if it is a number. Raises ModelTreeError."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        fail(where, "no number")
    return float(value)


def check_numbers(value: object, size: int, where: str) -> list[float]:
    """Return `value` if it is a list of `size` numbers. Raises ModelTreeError."""
    found = check_list(value, where, size)
    if len(found) != size:
        fail(where, f"not {size} numbers")
    return [check_number(each, where) for each in found]


def make_xyz(value: Sequence[float]) -> Xyz:
    """The first three of some numbers."""
    return (value[0], value[1], value[2])


def fail(where: str, reason: str) -> NoReturn:
    """Raise ModelTreeError with the text `where: reason`."""
    raise ModelTreeError(f"{make_visible(where)}: {make_visible(reason)}")
