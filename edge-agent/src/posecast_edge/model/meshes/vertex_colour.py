"""Colours that a mesh gives to each of its vertices, as paints: a few colours, each on triangles of its own.

The levels know paints, not vertex colours (docs/MODEL.md). Exporters use them for parts of a body, so a few
colours are right; a scan's colours are no parts, and become their mean.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.meshes.mesh import Paint, Surface

COLOURS_MAX = 16
CLOSE = 8 / 255  # colours nearer than this are one: rounding, or a breath of shading
DARK = 0.02
FEW = 1000  # triangles: so few may be parted however they like
RAGGED = 0.3  # of all edges lying between colours: no parts, but a picture


def split_all_by_colour(surfaces: Sequence[Surface]) -> list[Surface]:
    """Surfaces of one paint each. Where all vertices of a file without materials have one colour, that is
    spare: such a layer is more often an exporter's habit than the robot's colour, and RViz shows none."""
    parts = [part for surface in surfaces for part in split_by_colour(surface)]
    if any(surface.paint for surface in surfaces) or len({part.paint for part in parts}) > 1:
        return parts
    return [replace(part, paint=None, spare=part.paint) for part in parts]


def split_by_colour(surface: Surface) -> Iterator[Surface]:
    """Surfaces of one paint each; the same where there are no colours, or only black: a layer left empty."""
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
        yield Surface(surface.positions, surface.faces[own], surface.uv, Paint(rgba, paint.texture))


def _sorts(colours: NDArray[np.float64]) -> NDArray[np.int64]:
    """Which colour each has, counted from 0: median cut (Heckbert 1982), the widest box first."""
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
    """Whether the colours are no parts: too many edges have another colour on either side."""
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
