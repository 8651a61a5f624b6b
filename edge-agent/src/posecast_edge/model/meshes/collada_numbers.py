"""Reads lists of numbers in Collada's elements."""

from __future__ import annotations

import math
import warnings
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.mesh import Rgba
from posecast_edge.model.urdf.xml_tree import Element

T = TypeVar("T", np.float64, np.int64)


def extract_rgba(element: Element) -> Rgba:
    """The four numbers 0 … 1 in the element; light grey if it does not contain them."""
    values = extract_floats(element)
    if len(values) < 3 or not np.isfinite(values).all():
        return (0.8, 0.8, 0.8, 1.0)
    r, g, b, a = (min(max(float(v), 0.0), 1.0) for v in (*values[:3], values[3] if len(values) > 3 else 1.0))
    return (r, g, b, a)


def extract_floats(element: Element) -> NDArray[np.float64]:
    """All numbers in the element. Raises ModelRefused when it contains anything else."""
    return _numbers(element, np.float64)


def extract_integers(element: Element) -> NDArray[np.int64]:
    """All integers in the element. Raises ModelRefused when it contains anything else."""
    return _numbers(element, np.int64)


def _numbers(element: Element, kind: type[T]) -> NDArray[T]:
    if not element.text or element.text.isspace():
        return np.zeros(0, kind)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # older NumPy only warns about text after the last number
        try:
            return np.fromstring(element.text, kind, sep=" ")
        except (ValueError, OverflowError, DeprecationWarning):
            raise ModelRefused("a list with something other than numbers", element.line) from None


def convert_float(text: str | None, default: float) -> float:
    """Convert a text to a finite number, or return the default when it is not one."""
    try:
        value = float(text) if text is not None else default
    except ValueError:
        return default
    return value if math.isfinite(value) else default
