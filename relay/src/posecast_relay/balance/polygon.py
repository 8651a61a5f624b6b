"""Polygons on the floor: x and y in the world frame, metres."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

Xy = tuple[float, float]

# Twice the area (m²) that a corner spans with its neighbours at least. Two feet side by side have corners on
# one line, but for rounding.
SLIVER_M2 = 1e-9


class NearestEdge(NamedTuple):
    """The edge of a polygon that is nearest to a point. `corner`: the index of the corner where it begins;
    `margin_m`: how far the point is from it, positive inside, negative outside."""

    corner: int
    margin_m: float


def find_hull(points: Iterable[Xy]) -> list[Xy]:
    """The corners of the convex hull, counter-clockwise from the one with the least x (then y) on. Corners on
    a straight edge and repeated ones are left out: points on one line have a hull of 2, equal ones of 1.
    Takes n log n steps (Andrew's monotone chain, 1979)."""
    ordered = sorted(set(points))
    return _drop_slivers([*_chain(ordered), *_chain(ordered[::-1])] or ordered)


def find_nearest_edge(polygon: Sequence[Xy], point: Xy) -> NearestEdge | None:
    """The edge of a convex polygon, counter-clockwise, that is nearest to a point; None where there is no
    polygon. One of one or two corners has no inside."""
    nearest: tuple[float, int] | None = None
    is_inside = len(polygon) > 2
    for i, (ax, ay) in enumerate(polygon):
        bx, by = polygon[(i + 1) % len(polygon)]
        ex, ey, px, py = bx - ax, by - ay, point[0] - ax, point[1] - ay
        length2 = ex * ex + ey * ey
        along = min(1.0, max(0.0, (px * ex + py * ey) / length2)) if length2 > 0 else 0.0
        distance_m = math.hypot(px - along * ex, py - along * ey)
        is_inside = is_inside and ex * py - ey * px >= 0
        if nearest is None or distance_m < nearest[0]:
            nearest = distance_m, i
    if nearest is None:
        return None
    distance_m, corner = nearest
    return NearestEdge(corner, distance_m if is_inside else -distance_m)


def _drop_slivers(hull: list[Xy]) -> list[Xy]:
    """Without corners on a straight edge that both chains begin or end with: of an edge along y, rounding
    says which point is the first."""
    kept: list[Xy] = []
    left = len(hull)
    for i, (x, y) in enumerate(hull):
        ax, ay = kept[-1] if kept else hull[-1]
        bx, by = hull[(i + 1) % len(hull)]
        if left > 2 and (x - ax) * (by - ay) - (y - ay) * (bx - ax) <= SLIVER_M2:
            left -= 1
        else:
            kept.append((x, y))
    return kept


def _chain(ordered: Sequence[Xy]) -> list[Xy]:
    """One side of a hull, without its last corner, which begins the other side."""
    chain: list[Xy] = []
    for x, y in ordered:
        while len(chain) > 1:
            (ax, ay), (bx, by) = chain[-2:]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > SLIVER_M2:
                break
            chain.pop()
        chain.append((x, y))
    return chain[:-1]
