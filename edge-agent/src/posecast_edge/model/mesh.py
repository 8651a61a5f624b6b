"""A mesh as read from any format: surfaces, each with one paint, in metres and in the file's own axes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.finding import ModelRefused

FILE_MAX = 256 << 20  # bytes of one mesh file
TEXT_MAX = 128 << 20  # of one that is text: it takes ten times its size to read
TRIANGLES_MAX = 5_000_000  # of one mesh

Floats = NDArray[np.float32]
Faces = NDArray[np.int32]
Rgba = tuple[float, float, float, float]


@dataclass(frozen=True)
class Paint:
    """`rgba` as display (sRGB) values 0 … 1; `texture` is a picture file's bytes, multiplied with it."""

    rgba: Rgba
    texture: bytes | None = None


@dataclass(frozen=True)
class Surface:
    """Triangles of one paint: positions (n, 3), faces (m, 3) counter-clockwise seen from outside, uv (n, 2)
    with (0, 0) at the picture's upper left, or None. `paint` None: the file names none. `colours` (n, 3): of
    the vertices, display values multiplied with the paint, or None. `spare`: for where the URDF names no
    paint either."""

    positions: Floats
    faces: Faces
    uv: Floats | None = None
    paint: Paint | None = None
    colours: Floats | None = None
    spare: Paint | None = None


@dataclass(frozen=True)
class Mesh:
    """`notes`: what a reader had to be lenient about, (code, text)."""

    surfaces: tuple[Surface, ...]
    notes: tuple[tuple[str, str], ...] = ()

    @property
    def triangles(self) -> int:
        """All of them."""
        return sum(len(s.faces) for s in self.surfaces)

    def box(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner."""
        used = [s.positions[np.unique(s.faces)] for s in self.surfaces]
        return np.min([p.min(0) for p in used], axis=0), np.max([p.max(0) for p in used], axis=0)


def checked(mesh: Mesh) -> Mesh:
    """The same without empty surfaces. ModelRefused for what can't be drawn."""
    surfaces = []
    for surface in mesh.surfaces:
        if not len(surface.faces):
            continue
        if surface.faces.min() < 0 or surface.faces.max() >= len(surface.positions):
            raise ModelRefused("a triangle names a vertex that there is not")
        if not np.isfinite(surface.positions).all():
            raise ModelRefused("vertices that are not finite (NaN)")
        if np.abs(surface.positions).max() > 1e7:
            raise ModelRefused("vertices more than 10,000 km away")
        uv, colours = surface.uv, surface.colours
        if uv is not None and not np.isfinite(uv).all():
            uv = None
        if colours is not None:
            colours = None if not np.isfinite(colours).all() else np.clip(colours, 0, 1)
        surfaces.append(replace(surface, uv=uv, colours=colours))
    if not surfaces:
        raise ModelRefused("no triangles in it")
    if sum(len(s.faces) for s in surfaces) > TRIANGLES_MAX:
        raise ModelRefused(f"more than {TRIANGLES_MAX:,} triangles")
    return replace(mesh, surfaces=tuple(surfaces))


def fans(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Corner numbers (m, 3) of triangles that fill polygons of `counts` corners, corners counted through."""
    triangles = np.maximum(counts - 2, 0)
    first = np.repeat(np.cumsum(counts) - counts, triangles)
    step = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return np.stack([first, first + step + 1, first + step + 2], axis=1)
