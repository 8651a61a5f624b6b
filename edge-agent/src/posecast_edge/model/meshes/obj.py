"""Reads Wavefront OBJ with its material library."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from posecast_edge.model.finding import ModelRefused, quote_name
from posecast_edge.model.meshes.mesh import (
    TEXT_MAX,
    TRIANGLES_MAX,
    Floats,
    Load,
    Mesh,
    Notes,
    Paint,
    PolygonCutter,
    Rgba,
    Surface,
    clip_to_unit,
    select_used_vertices,
)
from posecast_edge.model.meshes.texture import Pictures

DEFAULT = (0.8, 0.8, 0.8)  # Kd
VERTICES_MAX = 3 * TRIANGLES_MAX  # also of texture coordinates: more could not be used
NUMBER_MAX = 1 << 31  # of a vertex
MATERIALS_MAX = 10_000  # of one mesh
LIBRARIES = re.compile(r"(?<=\.mtl)\s+", re.IGNORECASE)  # between the names of a line, which may have spaces


@dataclass
class _Group:
    """Faces of one material: corners as (vertex, texture) numbers from 0, -1 = none, and corners per face."""

    vertex: list[int] = field(default_factory=list)
    texture: list[int] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)


def read_obj(data: bytes, load: Load, keep_uv: bool = False, pictures: Pictures | None = None) -> Mesh:
    """Read a file. Raises ModelRefused when it is not OBJ; without its material library it has no colours.
    `keep_uv`: keep texture coordinates even without a picture."""
    if len(data) > TEXT_MAX:
        raise ModelRefused(f"an OBJ over {TEXT_MAX >> 20} MiB")
    notes = Notes()
    vertices: list[bytes] = []
    textures: list[bytes] = []
    groups: dict[str, _Group] = {}
    library = _Library(load, pictures or Pictures(), notes)
    group = groups.setdefault("", _Group())
    triangles = 0
    for line in data.removeprefix(BOM_UTF8).replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines():
        word, rest = (*line.split(None, 1), b"", b"")[:2]
        if word == b"v":
            vertices.append(rest)
        elif word == b"vt":
            textures.append(rest)
        elif word == b"f":
            triangles += _face(group, rest, len(vertices), len(textures))
            if triangles > TRIANGLES_MAX:
                raise ModelRefused(f"more than {TRIANGLES_MAX:,} triangles")
        elif word == b"usemtl":
            group = groups.setdefault(rest.strip().decode("utf-8", "replace"), _Group())
            if len(groups) > MATERIALS_MAX:
                raise ModelRefused(f"more than {MATERIALS_MAX:,} materials")
        elif word == b"mtllib":
            library.read_all(rest.strip().decode("utf-8", "replace"))
    if max(len(vertices), len(textures)) > VERTICES_MAX:
        raise ModelRefused(f"more than {VERTICES_MAX:,} vertices")
    positions = _rows(vertices, 3)
    uv = _rows(textures, 2)
    coloured = bool(vertices) and all(len(line) > 10 and _words(line, 6) for line in vertices)
    colours = _rows(vertices, 6)[:, 3:] if coloured else None  # v x y z r g b, as scanners write it
    cutter = PolygonCutter(notes)
    surfaces = []
    for name, group in groups.items():
        if group.counts:
            paint = library.paint(name)
            pictured = keep_uv or (paint is not None and paint.texture is not None)
            placed = library.place_picture(name, uv) if pictured else None
            surfaces.append(_surface(group, positions, placed, paint, colours, cutter))
    return Mesh(tuple(surfaces), notes.list_entries())


def _face(group: _Group, rest: bytes, vertices: int, textures: int) -> int:
    """Add a face. Returns its number of triangles."""
    corners = rest.split()
    if len(corners) < 3:
        return 0
    try:
        for corner in corners:
            numbers = corner.split(b"/", 2)
            v = int(numbers[0])
            t = int(numbers[1]) if len(numbers) > 1 and numbers[1] else 0
            if not -NUMBER_MAX < v < NUMBER_MAX or not -NUMBER_MAX < t < NUMBER_MAX:
                raise ModelRefused("a triangle refers to a vertex that does not exist")
            group.vertex.append(v - 1 if v > 0 else vertices + v)
            group.texture.append(t - 1 if t > 0 else textures + t if t < 0 else -1)
    except ValueError:
        raise ModelRefused("a face of the OBJ is not a list of numbers") from None
    group.counts.append(len(corners))
    return len(corners) - 2


def _rows(lines: list[bytes], width: int) -> Floats:
    """The first numbers of each line, (n, width)."""
    words = [_words(line, width) for line in lines]
    if not all(words):
        raise ModelRefused("a vertex of the OBJ is not a list of numbers")
    try:
        with np.errstate(over="ignore"):  # overflows to infinity, which is refused later
            flat = np.fromiter(map(float, chain.from_iterable(words)), np.float64, width * len(words))
            return flat.astype(np.float32).reshape(-1, width)
    except ValueError:
        raise ModelRefused("a vertex of the OBJ is not a list of numbers") from None


def _words(line: bytes, count: int) -> list[bytes]:
    """The first words of a line; [] where it has fewer."""
    words = line.split(None, count)[:count]
    return words if len(words) == count else []


def _surface(
    group: _Group,
    positions: Floats,
    uv: Floats | None,
    paint: Paint | None,
    colours: Floats | None,
    cutter: PolygonCutter,
) -> Surface:
    kept, vertex = select_used_vertices(np.array(group.vertex, np.int64), len(positions))
    corners = cutter.cut(np.array(group.counts, np.int64), positions[kept][vertex])
    texture = np.array(group.texture, np.int64)
    if uv is None or texture.min() < 0 or texture.max() >= len(uv):
        own = None if colours is None else colours[kept]
        return Surface(positions[kept], vertex[corners].astype(np.int32), None, paint, own)
    pairs, number = np.unique(np.stack([kept[vertex], texture], 1), axis=0, return_inverse=True)
    flipped = uv[pairs[:, 1]] * (1, -1) + (0, 1)  # OBJ counts from below
    return Surface(
        positions[pairs[:, 0]],
        number.reshape(-1)[corners].astype(np.int32),
        flipped.astype(np.float32),
        paint,
        None if colours is None else colours[pairs[:, 0]],
    )


class _Library:
    """The materials of an OBJ, from the files it names, each read once."""

    def __init__(self, load: Load, pictures: Pictures, notes: Notes) -> None:
        self._load = load
        self._pictures = pictures
        self._notes = notes
        self._known: set[str] = set()
        self._paints: dict[str, Paint] = {}
        self._placements: dict[str, tuple[Floats, Floats]] = {}  # scale and offset of a picture, from below

    def place_picture(self, name: str, uv: Floats) -> Floats:
        """Texture coordinates after a material's `-s` and `-o`."""
        scale, offset = self._placements.get(name, (1.0, 0.0))
        return uv * scale + offset

    def paint(self, name: str) -> Paint | None:
        """A material; None when no library has it."""
        paint = self._paints.get(name)
        return None if paint is None else _lit(paint)

    def read_all(self, names: str) -> None:
        """Read the files that a line names."""
        for name in LIBRARIES.split(names):
            self.read(name)

    def read(self, name: str) -> None:
        """Read one more file. A problem gives a note."""
        if name in self._known:
            return
        self._known.add(name)
        try:
            text = self._load(name).removeprefix(BOM_UTF8).decode("utf-8", "replace")
        except ModelRefused as e:
            self._notes.add("material-file", f"its material library {quote_name(name)}: {e.reason}")
            return
        paints: dict[str, Paint] = {}
        current = ""
        for line in text.splitlines():
            key, _, rest = line.strip().replace("\t", " ").partition(" ")
            key, rest = key.lower(), rest.strip()
            if key == "newmtl":
                current = rest
                paints[current] = Paint((*DEFAULT, 1.0))
            elif rest and current in paints:
                paints[current] = self._changed(paints[current], key, rest)
                if key == "map_kd":
                    words = rest.split()
                    self._placements[current] = (_option(words, "-s", 1.0), _option(words, "-o", 0.0))
        self._paints.update(paints)

    def _changed(self, paint: Paint, key: str, rest: str) -> Paint:
        words = rest.split()
        rgba: Rgba = paint.rgba
        try:
            if key == "kd" and len(words) >= 3:
                r, g, b = (clip_to_unit(float(word)) for word in words[:3])
                rgba = (r, g, b, paint.rgba[3])
            elif key in ("d", "tr"):
                a = float(words[-1]) if key == "d" else 1 - float(words[0])
                rgba = (*paint.rgba[:3], a if 0.02 < a < 1 else 1.0)
            elif key == "map_kd":
                return Paint(rgba, self._pictures.validate(self._load(_picture_name(words))))
        except ValueError:
            return paint
        except ModelRefused as e:
            self._notes.add("texture", f"its texture {quote_name(rest[-80:])}: {e.reason}")
            return paint
        return Paint(rgba, paint.texture)


def _picture_name(words: list[str]) -> str:
    """The file's name, which may contain spaces, after options such as `-s 1 1 1`."""
    at = 0
    while at < len(words) - 1 and words[at].startswith("-"):
        at += 2  # the option and its first value; further ones are numbers
        while at < len(words) - 1 and _is_number(words[at]):
            at += 1
    return " ".join(words[at:])


def _option(words: list[str], option: str, default: float) -> Floats:
    """The u and v of an option; a missing number is the default."""
    values = [default, default]
    if option in words[:-1]:
        for i, word in enumerate(words[words.index(option) + 1 :][:2]):
            if not _is_number(word):
                break
            values[i] = float(word)
    found = np.array(values, np.float32)
    return found if np.isfinite(found).all() else np.full(2, default, np.float32)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _lit(paint: Paint) -> Paint:
    """Use the picture alone: with a picture, exporters leave Kd black or at their default."""
    if paint.texture is not None and (max(paint.rgba[:3]) < 0.02 or paint.rgba[:3] == DEFAULT):
        return Paint((1.0, 1.0, 1.0, paint.rgba[3]), paint.texture)
    return paint
