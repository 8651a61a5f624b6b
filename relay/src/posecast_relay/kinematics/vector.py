"""Vectors of three numbers."""

from __future__ import annotations

from posecast_wire.mapping import Xyz


def add(a: Xyz, b: Xyz) -> Xyz:
    """a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Xyz, b: Xyz) -> Xyz:
    """a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(vector: Xyz, by: float) -> Xyz:
    """The vector times a number."""
    return (vector[0] * by, vector[1] * by, vector[2] * by)


def dot(a: Xyz, b: Xyz) -> float:
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Xyz, b: Xyz) -> Xyz:
    """a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
