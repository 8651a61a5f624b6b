"""Wavefront OBJ with its material library."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.mesh import TEXT_MAX, TRIANGLES_MAX, Mesh, Paint, Rgba, Surface, fans

Load = Callable[[str], bytes]  # a file named by the mesh; ModelRefused when it can't be had


@dataclass
class _Group:
    """Faces of one material: corners as (vertex, texture) numbers from 0, -1 = none, and corners per face."""

    vertex: list[int] = field(default_factory=list)
    texture: list[int] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)


def read_obj(data: bytes, load: Load) -> Mesh:
    """ModelRefused when it is none; a missing library only costs colours."""
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
    surfaces = [_surface(g, positions, uv, paints.get(name)) for name, g in groups.items() if g.counts]
    return Mesh(tuple(surfaces), tuple(notes))


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


def _rows(lines: list[bytes], width: int) -> np.ndarray[tuple[int, int], np.dtype[np.float32]]:
    try:
        return (
            np.array([line.split()[:width] for line in lines], np.float64)
            .astype(np.float32)
            .reshape(-1, width)
        )
    except ValueError:
        raise ModelRefused("a vertex of the OBJ is no list of numbers") from None


def _surface(
    group: _Group,
    positions: np.ndarray[tuple[int, int], np.dtype[np.float32]],
    uv: np.ndarray[tuple[int, int], np.dtype[np.float32]],
    paint: Paint | None,
) -> Surface:
    corners = fans(np.array(group.counts, np.int64))
    vertex = np.array(group.vertex, np.int64)
    if vertex.min() < 0 or vertex.max() >= len(positions):
        raise ModelRefused("a triangle names a vertex that there is not")
    texture = np.array(group.texture, np.int64)
    if paint is None or paint.texture is None or texture.min() < 0 or texture.max() >= len(uv):
        return Surface(positions, vertex[corners].astype(np.int32), None, _untextured(paint))
    pairs, number = np.unique(np.stack([vertex, texture], 1), axis=0, return_inverse=True)
    flipped = uv[pairs[:, 1]] * (1, -1) + (0, 1)  # OBJ counts from below
    return Surface(
        positions[pairs[:, 0]],
        number.reshape(-1)[corners].astype(np.int32),
        flipped.astype(np.float32),
        paint,
    )


def _untextured(paint: Paint | None) -> Paint | None:
    return None if paint is None else Paint(paint.rgba)


def _library(name: str, load: Load, notes: list[tuple[str, str]]) -> dict[str, Paint]:
    try:
        text = load(name).decode("utf-8", "replace")
    except ModelRefused as e:
        notes.append(("material-file", f"its material library {name[:80]!r}: {e.reason}"))
        return {}
    paints: dict[str, Paint] = {}
    current = ""
    for line in text.splitlines():
        words = line.split()
        if len(words) < 2:
            continue
        key, rest = words[0].lower(), words[1:]
        if key == "newmtl":
            current = " ".join(rest)
            paints[current] = Paint((0.8, 0.8, 0.8, 1.0))
        elif current in paints:
            paints[current] = _changed(paints[current], key, rest, load, notes)
    return paints


def _changed(paint: Paint, key: str, rest: list[str], load: Load, notes: list[tuple[str, str]]) -> Paint:
    try:
        r, g, b, a = paint.rgba
        rgba: Rgba = paint.rgba
        if key == "kd" and len(rest) >= 3:
            r, g, b = (min(max(float(x), 0.0), 1.0) for x in rest[:3])
            rgba = (r, g, b, a)
        elif key in ("d", "tr"):
            a = float(rest[-1]) if key == "d" else 1 - float(rest[0])
            rgba = (r, g, b, a if 0.02 < a < 1 else 1.0)
        elif key == "map_kd":
            return Paint(paint.rgba, load(rest[-1]))
    except ValueError:
        return paint
    except ModelRefused as e:
        notes.append(("texture", f"its texture {rest[-1][:80]!r}: {e.reason}"))
        return paint
    return Paint(rgba, paint.texture)
