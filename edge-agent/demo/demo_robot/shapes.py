"""Rounded shells as triangle meshes: every surface closed, every normal outwards, metres.

One idea makes them all: a *loft*, cross-sections strung along z and closed by rounded caps. A section is a
superellipse |x/a|^n + |y/b|^n = 1 whose front (+x) and back (-x) may differ: a calf bulges backwards.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Mesh:
    """Triangles. `vertices`: (n, 3) metres. `faces`: (m, 3), counter-clockwise seen from outside."""

    vertices: Floats
    faces: Ints

    def moved(self, x: float = 0, y: float = 0, z: float = 0) -> Mesh:
        """Shifted by metres."""
        return Mesh(self.vertices + np.array([x, y, z]), self.faces)

    def turned(self, axis: str, degrees: float) -> Mesh:
        """Turned about a coordinate axis through the origin."""
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        turned = self.vertices.copy()
        turned[:, i] = c * self.vertices[:, i] - s * self.vertices[:, j]
        turned[:, j] = s * self.vertices[:, i] + c * self.vertices[:, j]
        return Mesh(turned, self.faces)

    def mirrored(self) -> Mesh:
        """Left becomes right."""
        return Mesh(self.vertices * np.array([1, -1, 1]), self.faces[:, ::-1])


def joined(*meshes: Mesh) -> Mesh:
    """Several closed shells as one mesh."""
    faces, count = [], 0
    for mesh in meshes:
        faces.append(mesh.faces + count)
        count += len(mesh.vertices)
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


@dataclass(frozen=True)
class Section:
    """One cross-section at height z: half-widths to front, back and side; its centre; its squareness n."""

    z: float
    front: float
    back: float
    side: float
    x: float = 0.0
    y: float = 0.0
    n: float = 2.4


@dataclass(frozen=True)
class Cap:
    """How a loft ends: over `height` the section shrinks by the fraction `inset` along a quarter ellipse."""

    height: float
    inset: float = 1.0
    rings: int = 4


def smooth(x: Floats, y: Floats, at: Floats) -> Floats:
    """Monotone cubic interpolation (Fritsch & Carlson 1980) of y(x), column by column: no overshoot."""
    h = np.diff(x)[:, None]
    slope = np.diff(y, axis=0) / h
    d = np.zeros_like(y)
    d[0], d[-1] = slope[0], slope[-1]
    for i in range(1, len(x) - 1):
        same = slope[i - 1] * slope[i] > 0
        w1, w2 = 2 * h[i] + h[i - 1], h[i] + 2 * h[i - 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            d[i] = np.where(same, (w1 + w2) / (w1 / slope[i - 1] + w2 / slope[i]), 0.0)
    k = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(h) - 1)
    t = ((at - x[k]) / h[k, 0])[:, None]
    return np.asarray(
        (1 + 2 * t) * (1 - t) ** 2 * y[k]
        + t * (1 - t) ** 2 * h[k] * d[k]
        + t * t * (3 - 2 * t) * y[k + 1]
        + t * t * (t - 1) * h[k] * d[k + 1]
    )


class Loft:
    """Sections from bottom to top, with caps. The surface can be asked for points, to lay patches on it."""

    def __init__(self, sections: Sequence[Section], bottom: Cap, top: Cap) -> None:
        self._z = np.array([s.z for s in sections])
        self._shape = np.array([[s.front, s.back, s.side, s.x, s.y, s.n] for s in sections])
        self._bottom, self._top = bottom, top

    def points(self, angle: Floats, z: Floats, scale: Floats | float = 1.0) -> Floats:
        """(…, 3) points of the surface at polar angles (0 = front, π/2 = left) and heights."""
        flat = np.broadcast_to(z, np.broadcast_shapes(np.shape(angle), np.shape(z)))
        shape = smooth(self._z, self._shape, flat.ravel()).reshape((*flat.shape, 6))
        c, s = np.cos(angle), np.sin(angle)
        a = np.where(c >= 0, shape[..., 0], shape[..., 1])
        n = shape[..., 5]
        r = scale * (np.abs(c / a) ** n + np.abs(s / shape[..., 2]) ** n) ** (-1 / n)
        return np.stack([r * c + shape[..., 3], r * s + shape[..., 4], flat], axis=-1)

    def mesh(self, rings: int = 14, segments: int = 32) -> Mesh:
        """The closed surface."""
        z0, z1 = float(self._z[0]), float(self._z[-1])
        heights = [_cap_ring(self._bottom, i, z0, -1) for i in range(self._bottom.rings, 0, -1)]
        body0, body1 = z0 + self._bottom.height, z1 - self._top.height
        heights += [(body0 + (body1 - body0) * i / rings, 1.0) for i in range(rings + 1)]
        heights += [_cap_ring(self._top, i, z1, 1) for i in range(1, self._top.rings + 1)]
        zs = np.array([h[0] for h in heights])[:, None]
        scales = np.array([h[1] for h in heights])[:, None]
        angle = np.linspace(0, 2 * math.pi, segments, endpoint=False)[None, :]
        return _closed(self.points(angle, zs, scales))

    def patch(
        self,
        at: tuple[float, float],
        half: tuple[float, float],
        raised: float,
        depth: float = 0.004,
        n: float = 3.0,
        rings: int = 7,
        segments: int = 36,
    ) -> Mesh:
        """A plate that lies on the surface: centre (angle in degrees, z), half-extents (degrees, metres).

        It stands `raised` metres proud in its middle and sinks `depth` metres into the surface at its rim.
        """
        turn = np.arange(segments) * (2 * math.pi / segments)
        rim = (np.abs(np.cos(turn)) ** n + np.abs(np.sin(turn)) ** n) ** (-1 / n)
        t = 1 - np.linspace(0.0, 1.0, rings + 1)[:-1, None] ** 2  # rings crowd at the rim, which is steep
        u, v = t * rim * np.cos(turn), t * rim * np.sin(turn)
        outward = raised - (raised + depth) * t**40
        outer = self._offset(at, half, u, v, outward)
        unseen = slice(0, None, 3)  # the inner side needs no detail
        inner = self._offset(at, half, u[unseen], v[unseen], np.full_like(t[unseen], -depth - 0.002))[::-1]
        return _closed(np.concatenate([inner, outer]))

    def _offset(
        self, at: tuple[float, float], half: tuple[float, float], u: Floats, v: Floats, distance: Floats
    ) -> Floats:
        def surface(u: Floats, v: Floats) -> Floats:
            return self.points(np.radians(at[0] + half[0] * u), at[1] + half[1] * v)

        e = 1e-4
        normal = np.cross(surface(u + e, v) - surface(u - e, v), surface(u, v + e) - surface(u, v - e))
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return np.asarray(surface(u, v) + distance[..., None] * normal)


def _cap_ring(cap: Cap, i: int, end: float, sign: int) -> tuple[float, float]:
    """Height and scale of a cap's i-th ring, counted from the body. A dome's last ring is nearly a point."""
    phi = math.pi / 2 * i / cap.rings * (0.985 if cap.inset == 1 else 1)
    return end + sign * cap.height * (math.sin(phi) - 1), 1 - cap.inset * (1 - math.cos(phi))


def _closed(grid: Floats) -> Mesh:
    """(rings, segments, 3), counter-clockwise rings from bottom to top → a mesh closed by two fans."""
    rings, segments, _ = grid.shape
    vertices = np.concatenate([grid.reshape(-1, 3), grid[0].mean(0)[None], grid[-1].mean(0)[None]])
    j = np.arange(segments)
    k = (j + 1) % segments
    row = np.arange(rings - 1)[:, None] * segments
    a, b = (row + j).ravel(), (row + k).ravel()
    c, d = b + segments, a + segments
    last = (rings - 1) * segments
    bottom, top = rings * segments, rings * segments + 1
    faces = np.concatenate(
        [
            np.stack([a, b, c], 1),
            np.stack([a, c, d], 1),
            np.stack([k, j, np.full_like(j, bottom)], 1),
            np.stack([last + j, last + k, np.full_like(j, top)], 1),
        ]
    )
    return Mesh(vertices, faces)


def loft(sections: Sequence[Section], bottom: Cap, top: Cap, rings: int = 14, segments: int = 32) -> Mesh:
    """A closed shell through the sections."""
    return Loft(sections, bottom, top).mesh(rings, segments)


def ball(rx: float, ry: float | None = None, rz: float | None = None, segments: int = 28) -> Mesh:
    """An ellipsoid about the origin."""
    ry, rz = rx if ry is None else ry, rx if rz is None else rz
    phi = np.linspace(-math.pi / 2, math.pi / 2, segments // 2 + 1)[1:-1, None]
    angle = np.arange(segments)[None, :] * (2 * math.pi / segments)
    grid = np.stack(
        np.broadcast_arrays(
            rx * np.cos(phi) * np.cos(angle), ry * np.cos(phi) * np.sin(angle), rz * np.sin(phi)
        ),
        axis=-1,
    )
    return _closed(grid)


def revolved(profile: Sequence[tuple[float, float]], segments: int = 32) -> Mesh:
    """(radius, z) from bottom to top, turned about z and closed."""
    angle = np.arange(segments)[None, :] * (2 * math.pi / segments)
    r = np.array([p[0] for p in profile])[:, None]
    z = np.array([p[1] for p in profile])[:, None]
    return _closed(np.stack(np.broadcast_arrays(r * np.cos(angle), r * np.sin(angle), z), axis=-1))


def disc(radius: float, width: float, edge: float = 0.006, dish: float = 0.0, segments: int = 32) -> Mesh:
    """A joint housing: a round block about z with rounded edges; `dish` hollows both faces by that much."""
    half = width / 2
    arc = [math.pi / 2 * i / 3 for i in range(4)]
    rim = [(radius - edge + edge * math.sin(p), half - edge + edge * math.cos(p)) for p in arc]
    face = [(radius - edge - 0.004, half - dish)] if dish else []
    upper = [*reversed(rim), *face]
    return revolved([(r, -z) for r, z in reversed(upper)] + upper, segments)


def along(axis: str, mesh: Mesh) -> Mesh:
    """A shape made about z, laid along x or y."""
    return {"x": mesh.turned("y", 90), "y": mesh.turned("x", -90), "z": mesh}[axis]
