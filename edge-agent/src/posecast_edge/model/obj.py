"""Wavefront OBJ with its material library."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.mesh import TEXT_MAX, TRIANGLES_MAX, Floats, Mesh, Paint, Rgba, Surface, fans
from posecast_edge.model.texture import checked_picture

DEFAULT = (0.8, 0.8, 0.8)  # Kd

Load = Callable[[str], bytes]  # a file named by the mesh; ModelRefused when it can't be had


@dataclass
class _Group:
    """Faces of one material: corners as (vertex, texture) numbers from 0, -1 = none, and corners per face."""

    vertex: list[int] = field(default_factory=list)
    texture: list[int] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)


def read_obj(data: bytes, load: Load, keep_uv: bool = False) -> Mesh:
    """ModelRefused when it is none; a missing library only costs colours. `keep_uv`: even without picture."""
    if len(data) > TEXT_MAX:
        raise ModelRefused(f"an OBJ over {TEXT_MAX >> 20} MiB")
    notes: list[tuple[str, str]] = []
    vertices: list[bytes] = []
    textures: list[bytes] = []
    groups: dict[str, _Group] = {}
    paints: dict[str, Paint] = {}
    group = groups.setdefault("", _Group())
    for line in data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines():
        word, _, rest = line.strip().partition(b" ")
        if word == b"v":
            vertices.append(rest)
        elif word == b"vt":
            textures.append(rest)
        elif word == b"f":
            _face(group, rest, len(vertices), len(textures))
        elif word == b"usemtl":
            group = groups.setdefault(rest.strip().decode("utf-8", "replace"), _Group())
        elif word == b"mtllib":
            paints.update(_library(rest.strip().decode("utf-8", "replace"), load, notes))
    positions = _rows(vertices, 3)
    uv = _rows(textures, 2) if textures else np.zeros((0, 2), np.float32)
    coloured = bool(vertices) and all(line.count(b" ") >= 5 for line in vertices)
    colours = _rows(vertices, 6)[:, 3:] if coloured else None  # v x y z r g b, as scanners write it
    surfaces = [
        _surface(
            g, positions, uv if keep_uv or _pictured(paints.get(name)) else None, paints.get(name), colours
        )
        for name, g in groups.items()
        if g.counts
    ]
    return Mesh(tuple(surfaces), tuple(notes))


def _pictured(paint: Paint | None) -> bool:
    return paint is not None and paint.texture is not None


def _face(group: _Group, rest: bytes, vertices: int, textures: int) -> None:
    corners = rest.split()
    if len(corners) < 3:
        return
    try:
        for corner in corners:
            numbers = corner.split(b"/")
            v = int(numbers[0])
            t = int(numbers[1]) if len(numbers) > 1 and numbers[1] else 0
            group.vertex.append(v - 1 if v > 0 else vertices + v)
            group.texture.append(t - 1 if t > 0 else textures + t if t < 0 else -1)
    except ValueError:
        raise ModelRefused("a face of the OBJ is no list of numbers") from None
    group.counts.append(len(corners))
    if len(group.counts) > TRIANGLES_MAX:
        raise ModelRefused(f"more than {TRIANGLES_MAX:,} triangles")


def _rows(lines: list[bytes], width: int) -> Floats:
    try:
        return (
            np.array([line.split()[:width] for line in lines], np.float64)
            .astype(np.float32)
            .reshape(-1, width)
        )
    except ValueError:
        raise ModelRefused("a vertex of the OBJ is no list of numbers") from None


def _surface(
    group: _Group, positions: Floats, uv: Floats | None, paint: Paint | None, colours: Floats | None
) -> Surface:
    corners = fans(np.array(group.counts, np.int64))
    vertex = np.array(group.vertex, np.int64)
    if vertex.min() < 0 or vertex.max() >= len(positions):
        raise ModelRefused("a triangle names a vertex that there is not")
    texture = np.array(group.texture, np.int64)
    if uv is None or texture.min() < 0 or texture.max() >= len(uv):
        return Surface(positions, vertex[corners].astype(np.int32), None, paint, colours)
    pairs, number = np.unique(np.stack([vertex, texture], 1), axis=0, return_inverse=True)
    flipped = uv[pairs[:, 1]] * (1, -1) + (0, 1)  # OBJ counts from below
    return Surface(
        positions[pairs[:, 0]],
        number.reshape(-1)[corners].astype(np.int32),
        flipped.astype(np.float32),
        paint,
        None if colours is None else colours[pairs[:, 0]],
    )


def _library(name: str, load: Load, notes: list[tuple[str, str]]) -> dict[str, Paint]:
    try:
        text = load(name).decode("utf-8", "replace")
    except ModelRefused as e:
        notes.append(("material-file", f"its material library {name[:80]!r}: {e.reason}"))
        return {}
    paints: dict[str, Paint] = {}
    current = ""
    for line in text.splitlines():
        key, _, rest = line.strip().replace("\t", " ").partition(" ")
        key, rest = key.lower(), rest.strip()
        if key == "newmtl":
            current = rest
            paints[current] = Paint((*DEFAULT, 1.0))
        elif rest and current in paints:
            paints[current] = _changed(paints[current], key, rest, load, notes)
    return {name: _lit(paint) for name, paint in paints.items()}


def _changed(paint: Paint, key: str, rest: str, load: Load, notes: list[tuple[str, str]]) -> Paint:
    words = rest.split()
    rgba: Rgba = paint.rgba
    try:
        if key == "kd" and len(words) >= 3:
            r, g, b = (min(max(float(x), 0.0), 1.0) for x in words[:3])
            rgba = (r, g, b, paint.rgba[3])
        elif key in ("d", "tr"):
            a = float(words[-1]) if key == "d" else 1 - float(words[0])
            rgba = (*paint.rgba[:3], a if 0.02 < a < 1 else 1.0)
        elif key == "map_kd":
            return Paint(rgba, checked_picture(load(_picture_name(words))))
    except ValueError:
        return paint
    except ModelRefused as e:
        notes.append(("texture", f"its texture {rest[-80:]!r}: {e.reason}"))
        return paint
    return Paint(rgba, paint.texture)


def _picture_name(words: list[str]) -> str:
    """The file's name, which may have spaces, behind options like `-s 1 1 1`."""
    at = 0
    while at < len(words) - 1 and words[at].startswith("-"):
        at += 2  # the option and its first value; further ones are numbers
        while at < len(words) - 1 and _is_number(words[at]):
            at += 1
    return " ".join(words[at:])


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _lit(paint: Paint) -> Paint:
    """A picture alone: exporters leave Kd at black, or at their default, where the picture says it all."""
    if paint.texture is not None and (max(paint.rgba[:3]) < 0.02 or paint.rgba[:3] == DEFAULT):
        return Paint((1.0, 1.0, 1.0, paint.rgba[3]), paint.texture)
    return paint
