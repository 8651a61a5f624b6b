"""A mesh as read from any format: surfaces, each with one paint, in metres and in the file's own axes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import mapbox_earcut
import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.finding import ModelRefused, make_printable, quote_name
from posecast_edge.model.urdf.types import FAR_M

FILE_MAX = 256 << 20  # bytes of one mesh file
TEXT_MAX = 128 << 20  # of a text file: reading it takes ten times its size
TRIANGLES_MAX = 5_000_000  # of one mesh
NOTES_MAX = 20  # of one mesh; further ones are dropped
SHOWN_AGAIN_MAX = 1_000_000  # triangles that repeated parts may add to those that the file's bytes can hold
NAMES_SHOWN = 6  # in one line
UP_NOTES = ("collada-axis", "gltf-axis")  # the codes of notes about an up axis
GLTF_UP = "the y axis of glTF is up"
PLACING = 128  # triangles counted for placing a part, in addition to its own

Floats = NDArray[np.float32]
Faces = NDArray[np.int32]
Rgba = tuple[float, float, float, float]
Load = Callable[[str], bytes]  # reads a file named by the mesh; raises ModelRefused when it can't


@dataclass(frozen=True)
class Paint:
    """`rgba` as display (sRGB) values 0 … 1; `texture` is a picture file's bytes, multiplied with it."""

    rgba: Rgba
    texture: bytes | None = None


@dataclass(frozen=True)
class Surface:
    """Triangles of one paint: positions (n, 3), faces (m, 3) counter-clockwise seen from outside, uv (n, 2)
    with (0, 0) at the picture's upper left, or None. `paint` None: the file has none. `colours` (n, 3): of
    the vertices, display values multiplied with the paint, or None. `spare`: paint to use if the URDF has
    none either. `names`: the file's names for the part; empty if the file is one part."""

    positions: Floats
    faces: Faces
    uv: Floats | None = None
    paint: Paint | None = None
    colours: Floats | None = None
    spare: Paint | None = None
    names: tuple[str, ...] = ()


# z-up from a file's up axis, right-handed (Collada's table)
UPRIGHT = {
    "Y_UP": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "X_UP": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
}


@dataclass(frozen=True)
class Mesh:
    """Surfaces with their paints. `notes`: (code, text) of problems that the reader tolerated. `up`: the
    file's up axis (a key of UPRIGHT) if it is not z and has not been applied, otherwise "". `is_up_certain`:
    the format itself says which axis is up (glTF), so that no exporter can have meant another."""

    surfaces: tuple[Surface, ...]
    notes: tuple[tuple[str, str], ...] = ()
    up: str = ""
    is_up_certain: bool = False

    @property
    def triangles(self) -> int:
        """Number of triangles of all surfaces."""
        return sum(len(s.faces) for s in self.surfaces)

    def compute_box(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner (x, y, z), metres, of the vertices that triangles use."""
        used = [s.positions[np.unique(s.faces)] for s in self.surfaces]
        return np.min([p.min(0) for p in used], axis=0), np.max([p.max(0) for p in used], axis=0)


def pick_part(mesh: Mesh, name: str, is_centred: bool) -> Mesh:
    """The surfaces of a mesh that the file calls `name`; all of them for "" or if the file has no names.
    `is_centred`: move the middle of their box to the origin. Raises ModelRefused when only other names exist.
    """
    found = tuple(s for s in mesh.surfaces if name in s.names) if name else mesh.surfaces
    known = dict.fromkeys(n for s in mesh.surfaces for n in s.names)
    if known and not found:
        others = ", ".join(map(quote_name, list(known)[:NAMES_SHOWN]))
        more = " …" if len(known) > NAMES_SHOWN else ""
        raise ModelRefused(f"it has no part {quote_name(name)}, but {others}{more}")
    part = replace(mesh, surfaces=found or mesh.surfaces)
    if not is_centred:
        return part
    low, high = part.compute_box()
    middle = ((low + high) / 2).astype(np.float32)
    return replace(part, surfaces=tuple(replace(s, positions=s.positions - middle) for s in part.surfaces))


def turn_upright(mesh: Mesh) -> Mesh:
    """The mesh with its file's up axis turned to z, and a note about it."""
    if mesh.up not in UPRIGHT:
        return mesh
    turn = UPRIGHT[mesh.up].astype(np.float32)
    surfaces = tuple(replace(s, positions=s.positions @ turn.T) for s in mesh.surfaces)
    kept = tuple(note for note in mesh.notes if note[0] not in UP_NOTES)
    collada, gltf = UP_NOTES
    said = (
        (gltf, f"{GLTF_UP}; turned to z") if mesh.is_up_certain else (collada, f"it says {mesh.up}; applied")
    )
    return Mesh(surfaces, (said, *kept))


class Expansion:
    """Counts how large a file's scene becomes. A part may be shown many times, so a small file can describe a
    huge scene; it is counted before anything is made."""

    def __init__(self, size: int) -> None:
        """`size`: bytes of the file; each triangle in it takes at least one."""
        self._left = SHOWN_AGAIN_MAX + size
        self._triangles = 0

    def add_bytes(self, size: int) -> None:
        """Count `size` bytes of another file that this file refers to as its own."""
        self._left += size

    def add_part(self, triangles: int) -> None:
        """Count one more part with this many triangles. Raises ModelRefused when the scene grows too large
        for its file."""
        self._triangles += triangles
        self._left -= triangles + PLACING
        if self._triangles > TRIANGLES_MAX:
            raise ModelRefused(f"more than {TRIANGLES_MAX:,} triangles")
        if self._left < 0:
            raise ModelRefused(
                f"repeats its parts so often that they add more than {SHOWN_AGAIN_MAX:,} triangles"
            )


class Notes:
    """Problems that a reader tolerated, without duplicates, at most NOTES_MAX."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str], None] = {}

    def add(self, code: str, text: str) -> None:
        """Note `text` under `code`, as one line of at most 200 characters."""
        if len(self._found) < NOTES_MAX:
            self._found[code, make_printable(text[:200])] = None

    def list_entries(self) -> tuple[tuple[str, str], ...]:
        """The notes as (code, text), in order."""
        return tuple(self._found)


def clip_to_unit(value: float) -> float:
    """`value` clipped to 0 … 1. Raises ValueError when it is not finite."""
    if not math.isfinite(value):
        raise ValueError(f"{value} is not finite")
    return min(max(value, 0.0), 1.0)


def select_used_vertices(
    numbers: NDArray[np.int64], count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the used ones of `count` vertices, ascending, and `numbers` renumbered to index these. Without
    this, each of several surfaces that share a file's vertices would carry all of them.

    Raises ModelRefused when a number is out of range.
    """
    if len(numbers) and (numbers.min() < 0 or numbers.max() >= count):
        raise ModelRefused("a triangle refers to a vertex that does not exist")
    if count > 4 * len(numbers):  # few of many: avoid work proportional to all of them
        kept, place = np.unique(numbers, return_inverse=True)
        return kept, place.reshape(-1)
    used = np.zeros(count, bool)
    used[numbers] = True
    return np.flatnonzero(used), (np.cumsum(used) - 1)[numbers]


def validate_mesh(mesh: Mesh) -> Mesh:
    """Return the mesh without empty surfaces. Raises ModelRefused when nothing is left or it can't be
    drawn."""
    surfaces = []
    for surface in mesh.surfaces:
        if not len(surface.faces):
            continue
        if surface.faces.min() < 0 or surface.faces.max() >= len(surface.positions):
            raise ModelRefused("a triangle refers to a vertex that does not exist")
        if not np.isfinite(surface.positions).all():
            raise ModelRefused("vertices that are not finite (NaN)")
        if np.abs(surface.positions).max() > FAR_M:
            raise ModelRefused("vertices more than 10,000 km away")
        uv, colours = surface.uv, surface.colours
        if uv is not None and not np.isfinite(uv).all():
            uv = None
        if colours is not None:
            colours = None if not np.isfinite(colours).all() else np.clip(colours, 0, 1)
        surfaces.append(replace(surface, uv=uv, colours=colours))
    if not surfaces:
        raise ModelRefused("it has no triangles")
    if sum(len(s.faces) for s in surfaces) > TRIANGLES_MAX:
        raise ModelRefused(f"more than {TRIANGLES_MAX:,} triangles")
    return replace(mesh, surfaces=tuple(surfaces))


def triangulate_fans(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Divide convex polygons with `counts` corners into triangles (m, 3) of corner numbers. Corners are
    numbered through all polygons."""
    triangles = np.maximum(counts - 2, 0)
    first = np.repeat(np.cumsum(counts) - counts, triangles)
    step = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return np.stack([first, first + step + 1, first + step + 2], axis=1)


# --- polygons of any shape; the page does the same (spa/src/urdf/meshes/polygons.ts)

EARS_MAX = 10_000  # corners of a polygon that is cut: cutting takes up to their square
EARS_WORK_MAX = 2_000_000_000  # sum of those squares, of one mesh
BEYOND_EARS = ("polygon", "polygons with too many corners; their notches and holes are filled")
STRAIGHT = 1e-6  # sine of an angle: corners that turn back by less count as straight


class PolygonCutter:
    """Divides the polygons of one mesh into triangles. Convex ones become fans; others are cut by ears, as
    far as their corners allow it."""

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._work = 0

    def cut(self, counts: NDArray[np.int64], corners: NDArray[np.floating]) -> NDArray[np.int64]:
        """Divide polygons with `counts` corners, at `corners` (n, 3), into triangles (m, 3) of corner
        numbers, in the polygons' order."""
        triangles = triangulate_fans(counts)
        starts = np.cumsum(counts) - counts
        turned_back = _find_reflex(counts, corners.astype(np.float64))
        if not turned_back.any():
            return triangles
        first = np.cumsum(np.maximum(counts - 2, 0)) - np.maximum(counts - 2, 0)  # triangle of a polygon
        quads = np.flatnonzero(counts == 4)
        other = quads[turned_back[starts[quads] + 1] | turned_back[starts[quads] + 3]]  # diagonal
        for triangle, ends in enumerate(((1, 2, 3), (1, 3, 0))):
            triangles[first[other] + triangle] = starts[other][:, None] + ends
        of = np.repeat(np.arange(len(counts)), counts)  # polygon of a corner
        concave = np.unique(of[turned_back[: len(of)]])
        replaced = np.zeros(len(triangles), bool)
        pieces, order = [], []
        for number in concave[counts[concave] > 4].tolist():
            start, count = int(starts[number]), int(counts[number])
            cut = self.cut_rings([corners[start : start + count]])
            if cut is not None:
                replaced[first[number] : first[number] + count - 2] = True
                pieces.append(cut + start)
                order.append(np.full(len(cut), first[number]))
        if not pieces:
            return triangles
        kept = np.flatnonzero(~replaced)
        every = np.concatenate([triangles[kept], *pieces])
        return every[np.argsort(np.concatenate([kept, *order]), kind="stable")]

    def cut_rings(self, rings: list[NDArray[np.floating]]) -> NDArray[np.int64] | None:
        """Cut an outline and its holes, each (n, 3), into triangles of corner numbers through all rings. None
        if they have too many corners or no area."""
        corners = np.concatenate(rings).astype(np.float64)
        self._work += len(corners) ** 2
        if len(corners) > EARS_MAX or self._work > EARS_WORK_MAX:
            self._notes.add(*BEYOND_EARS)
            return None
        normal = _normals(np.array([len(rings[0])]), corners[: len(rings[0])])[0]
        if len(rings[0]) < 3 or not np.isfinite(corners).all() or not normal.any():
            return None
        drop = int(np.abs(normal).argmax())
        axes = [(1, 2), (2, 0), (0, 1)][drop]
        flat = (corners - corners[0])[:, axes if normal[drop] > 0 else axes[::-1]]
        flat /= np.abs(flat).max()
        ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
        cut = (
            mapbox_earcut.triangulate_float64(np.ascontiguousarray(flat), ends)
            .reshape(-1, 3)
            .astype(np.int64)
        )
        (ax, ay), (bx, by), (cx, cy) = (flat[cut[:, k]].T for k in range(3))
        doubled = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        return cut[:, ::-1] if doubled.sum() < 0 else cut


def _normals(counts: NDArray[np.int64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Newell's normals (n, 3) of polygons, with a length of twice their area."""
    starts = np.cumsum(counts) - counts
    following = np.arange(1, len(corners) + 1)
    following[starts + counts - 1] = starts
    about = np.repeat(corners[starts], counts, axis=0)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.add.reduceat(np.cross(corners - about, corners[following] - about), starts))


def _find_reflex(counts: NDArray[np.int64], corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Of each corner, whether it turns back, or may: one at the same place as the next. A triangle has
    none."""
    found = np.zeros(len(corners), bool)
    large = counts[counts > 3]
    if not len(large):
        return found
    inside = np.flatnonzero(np.repeat(counts > 3, counts))
    points, starts = corners[inside], np.cumsum(large) - large
    before, after = np.arange(-1, len(points) - 1), np.arange(1, len(points) + 1)
    before[starts] = starts + large - 1
    after[starts + large - 1] = starts
    with np.errstate(over="ignore", invalid="ignore"):
        normals = np.repeat(_normals(large, points), large, axis=0)
        come, go = points - points[before], points[after] - points
        turn = np.einsum("ij,ij->i", np.cross(come, go), normals)
        lengths = np.linalg.norm(come, axis=1) * np.linalg.norm(go, axis=1) * np.linalg.norm(normals, axis=1)
        found[inside] = (turn < -STRAIGHT * lengths) | (lengths == 0)
    return found
