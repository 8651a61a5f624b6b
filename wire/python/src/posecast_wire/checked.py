"""Typed values out of JSON that strangers wrote: every failure says where it stands and why."""

from __future__ import annotations

import json
import math
import re
from typing import NoReturn, cast

TEXT_MAX = 200  # characters in any one name
UNFIT = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff]")


class SchemaError(ValueError):
    """A schema that cannot be used: one line, `where: reason`."""


def fail(where: str, reason: str) -> NoReturn:
    """Raise SchemaError `where: reason`."""
    raise SchemaError(f"{where}: {reason}")


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not JSON")


def loads(text: str | bytes) -> object:
    """Parse JSON as browsers do: no NaN, no Infinity. ValueError on anything else, also on absurd depth."""
    try:
        return cast(object, json.loads(text, parse_constant=_refuse_constant))
    except RecursionError:
        raise ValueError("nested too deeply") from None


def table(value: object, where: str) -> dict[str, object]:
    """An object; absent (None) reads as empty."""
    if value is None:
        return {}
    if not isinstance(value, dict):
        fail(where, "must be an object")
    return value


def items(value: object, where: str) -> list[object]:
    """A list."""
    if not isinstance(value, list):
        fail(where, "must be a list")
    return value


def text(value: object, where: str) -> str:
    """A text of 1 to 200 characters, none of them a control character or half a surrogate pair."""
    if not isinstance(value, str) or not 0 < len(value) <= TEXT_MAX or UNFIT.search(value):
        fail(where, f"must be a text of 1 to {TEXT_MAX} characters without control characters")
    return value


def number(value: object, where: str) -> float:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        fail(where, "must be a number")
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        fail(where, "must be a finite number")
    return result


def texts(value: object, where: str) -> tuple[str, ...]:
    """A list of texts, none twice."""
    found = tuple(text(item, f"{where}[{i}]") for i, item in enumerate(items(value, where)))
    if len(set(found)) != len(found):
        twice = next(t for i, t in enumerate(found) if t in found[:i])
        fail(where, f"{twice!r} stands there twice")
    return found
