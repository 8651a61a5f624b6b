"""Converts vertex colours to paints: a few colours, each on its own triangles.

Levels of detail have paints but no vertex colours (docs/reference/model-bundle.md). Exporters use vertex
colours to mark parts of a body, so a few colours are kept; the many colours of a scan are replaced by their
mean.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.meshes.mesh import Paint, Surface

COLOURS_MAX = 16
CLOSE = 8 / 255  # colours nearer than this count as one: rounding, or slight shading
DARK = 0.02
FEW = 1000  # triangles: up to this many are always split
RAGGED = 0.3  # of all edges lying between colours: beyond it, the colours are an image, not parts


def split_all_by_colour(surfaces: Sequence[Surface]) -> list[Surface]:
    """Split into surfaces of one paint each. If a file without materials gives all vertices the same colour,
    it becomes the spare paint: that is usually an exporter's default and not the robot's colour, and RViz
    ignores it."""
    parts = [part for surface in surfaces for part in split_by_colour(surface)]
    if any(surface.paint for surface in surfaces) or len({part.paint for part in parts}) > 1:
        return parts
    return [replace(part, paint=None, spare=part.paint) for part in parts]


def split_by_colour(surface: Surface) -> Iterator[Surface]:
    """Split a surface into surfaces of one paint each. It is left as it is if it has no colours or only
    black, which is an unused layer."""
    if surface.colours is None or surface.colours.max() < DARK:
        yield replace(surface, colours=None)
        return
    paint = surface.paint or Paint((1.0, 1.0, 1.0, 1.0))
    colours = surface.colours[surface.faces].mean(1).astype(np.float64)  # of a triangle
    sort = _sorts(colours)
    if _ragged(surface, sort):
        sort = np.zeros(len(colours), np.int64)
    for number in range(int(sort.max()) + 1):
        own = sort == number
        r, g, b = (float(v) for v in np.round(colours[own].mean(0), 4))
        rgba = (paint.rgba[0] * r, paint.rgba[1] * g, paint.rgba[2] * b, paint.rgba[3])
        yield Surface(
            surface.positions, surface.faces[own], surface.uv, Paint(rgba, paint.texture), names=surface.names
        )


def _sorts(colours: NDArray[np.float64]) -> NDArray[np.int64]:
    """The number of each triangle's colour, from 0: median cut (Heckbert 1982), the widest box first."""
    sort = np.zeros(len(colours), np.int64)
    for new in range(1, COLOURS_MAX):
        boxes = [colours[sort == k] for k in range(new)]
        spans = np.array([np.ptp(box, axis=0) for box in boxes])
        widest, channel = np.unravel_index(int(spans.argmax()), spans.shape)
        if spans[widest, channel] <= CLOSE:
            break
        values = boxes[widest][:, channel]
        middle = (values.min() + values.max()) / 2
        sort[(sort == widest) & (colours[:, channel] > middle)] = new
    return sort


def _ragged(surface: Surface, sort: NDArray[np.int64]) -> bool:
    """Whether the colours mark no parts, because too many edges separate different colours."""
    if not sort.any() or len(sort) < FEW:
        return False
    _, place = np.unique(surface.positions, axis=0, return_inverse=True)
    corners = place.reshape(-1)[surface.faces]
    edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    key = edges[:, 0].astype(np.int64) << 32 | edges[:, 1]
    order = np.argsort(key, kind="stable")
    key, of = key[order], np.tile(sort, 3)[order]
    shared = key[1:] == key[:-1]
    return bool(shared.any()) and bool((of[1:] != of[:-1])[shared].mean() > RAGGED)
