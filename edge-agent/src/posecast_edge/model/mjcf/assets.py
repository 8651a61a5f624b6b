"""Takes the meshes and pictures out of a MuJoCo model and compiles each in its own small model.

MuJoCo builds a bounding volume hierarchy for each mesh, and keeps it with copies of everything until the
whole model is compiled: several hundred megabytes, of which twenty are drawn. Compiled one by one, meshes
need less, because the memory is freed each time. In the model, a box and a white point replace them. Bodies
and joints are not affected, and a geom that shows the box is where its file puts it.
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.finding import quote_name
from posecast_edge.model.mjcf.compiled import PICTURE_PIXELS_MAX

PICTURE_SIDE_MAX = 2048  # pixels; the finest level has no more
PNG = b"\x89PNG\r\n\x1a\n"
# what MuJoCo raises
FAILURES = (ValueError, TypeError, LookupError, RuntimeError, MemoryError, RecursionError, mujoco.FatalError)

# Its sides are its principal axes, in MuJoCo's order, and its middle is 0: MuJoCo neither turns nor moves it.
BOX = [v for x in (-1.0, 1.0) for y in (-2.0, 2.0) for z in (-3.0, 3.0) for v in (x, y, z)]
SIDES = [
    *(0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1),
    *(2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3),
]
MESH_SAYS = ("content_type", "scale", "refpos", "refquat", "info")  # what moves its vertices
PICTURE_SAYS = (
    *("type", "colorspace", "nchannel", "content_type", "gridsize", "gridlayout", "hflip", "vflip", "info"),
)
MESH = mujoco.mjtGeom.mjGEOM_MESH
NO_CUBE = [""] * 6


class AssetFailed(Exception):
    """A mesh or a picture that MuJoCo can't read, by its name and its file's; the cause is what MuJoCo
    raised."""


@dataclass(frozen=True)
class TakenMesh:
    """A mesh in the frame of its file, with what the model says of scale and place applied: positions (n, 3),
    faces (m, 3), texture coordinates (k, 2) and which of them each face's corners have (m, 3)."""

    positions: NDArray[np.float32]
    faces: NDArray[np.int32]
    uv: NDArray[np.float32]
    corners: NDArray[np.int32]


@dataclass
class TakenAssets:
    """By name: meshes, and pictures as (height, width, channels); `boxes`: the meshes that a box stands in
    for; `remarks`: what is not shown, and why."""

    meshes: dict[str, TakenMesh] = field(default_factory=dict)
    boxes: set[str] = field(default_factory=set)
    pictures: dict[str, NDArray[np.uint8]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)


def take_assets(spec: Any, contents: Mapping[str, bytes]) -> TakenAssets:
    """Compile the meshes and pictures of a MjSpec that come from a file, and replace them by placeholders.
    `contents`: files by path. Raises AssetFailed.

    A mesh that depends on more than its file stays: one that a primitive is fitted to, or that a plug-in
    makes. So does a missing one, for which MuJoCo reports where it looked.
    """
    taken = TakenAssets()
    places = sort_by_name(contents)
    fitted = {geom.meshname for geom in spec.geoms if geom.type != MESH}
    shown = {geom.meshname for geom in spec.geoms}
    for mesh in spec.meshes:
        path = find_path(mesh.file, _folder(mesh, "meshdir"), contents, places)
        if path and not (mesh.name in fitted or mesh.needsdf or mesh.plugin.active):
            if mesh.name in shown:
                with _name_failure("mesh", mesh.name, mesh.file):
                    taken.meshes[mesh.name] = _compile_mesh(mesh, path, contents[path])
            _stand_in_mesh(mesh)
            taken.boxes.add(mesh.name)
    for picture in spec.textures:
        path = find_path(picture.file, _folder(picture, "texturedir"), contents, places)
        if picture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            _stand_in_picture(picture)
        elif path and contents[path].startswith(PNG):
            if _count_pixels(contents[path]) <= PICTURE_PIXELS_MAX:
                with _name_failure("texture", picture.name, picture.file):
                    taken.pictures[picture.name] = _compile_picture(picture, path, contents[path])
            else:
                text = f"texture {quote_name(picture.name)}: more than 4096 × 4096 points; not shown"
                taken.remarks.append(text)
            _stand_in_picture(picture)
    return taken


def list_guessed_bodies(spec: Any, boxes: Collection[str]) -> list[int]:
    """The bodies of a compiled MjSpec whose mass MuJoCo derived from `boxes`, which replace meshes."""
    by_geoms = spec.compiler.inertiafromgeom
    low, high = spec.compiler.inertiagrouprange
    guessed = [
        body.id
        for body in spec.bodies
        if by_geoms == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
        or (by_geoms == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO and not body.explicitinertial)
        if any(
            geom.meshname in boxes and low <= geom.group <= high and not _is_weightless(geom)
            for geom in body.geoms
        )
    ]
    return list(range(1, len(spec.bodies))) if guessed and spec.compiler.settotalmass > 0 else guessed


def _is_weightless(geom: Any) -> bool:
    return bool(geom.mass == 0 or (math.isnan(geom.mass) and geom.density == 0))


def sort_by_name(paths: Iterable[str]) -> dict[str, list[str]]:
    """Paths by the last part of each."""
    places: dict[str, list[str]] = {}
    for path in paths:
        places.setdefault(path.rpartition("/")[2], []).append(path)
    return places


def find_path(
    name: str, folder: str, contents: Mapping[str, bytes], places: Mapping[str, Sequence[str]]
) -> str | None:
    """The one file that is meant by a name in a folder, both as the model has them; None where there is no
    such file, or several that differ. `places`: the paths of `contents` by name."""
    for wanted in (os.path.join(folder, name), name) if name else ():
        parts = PurePosixPath(os.path.normpath(wanted.replace("\\", "/"))).parts
        tail = "/".join(part for part in parts if part not in ("..", "/"))
        found = [path for path in places.get(tail.rpartition("/")[2], ()) if path.endswith(f"/{tail}")]
        if found:
            same = all(contents[path] == contents[found[0]] for path in found[1:])
            return found[0] if same else None
    return None


@contextmanager
def _name_failure(kind: str, name: str, file: str) -> Iterator[None]:
    try:
        yield
    except FAILURES as e:
        raise AssetFailed(f"{kind} {quote_name(name)}, file {quote_name(file)}") from e


def _folder(element: Any, kind: str) -> str:
    return str(getattr(element.compiler, kind, "") or "")


def _compile(spec: Any, path: str, content: bytes) -> Any:
    spec.compiler.usethread = False
    with mujoco.MjVfs() as files:
        files[path] = content
        return spec.compile(files)


def _compile_mesh(mesh: Any, path: str, content: bytes) -> TakenMesh:
    spec = mujoco.MjSpec()
    alone = spec.add_mesh(name=mesh.name, file=path)
    for attribute in MESH_SAYS:
        setattr(alone, attribute, getattr(mesh, attribute))
    # how its mass is spread is of no use; a shell has a centre also where nothing is closed
    alone.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    spec.worldbody.add_geom(type=MESH, meshname=mesh.name, contype=0, conaffinity=0)
    model = _compile(spec, path, content)
    turned = np.zeros(9)
    mujoco.mju_quat2Mat(turned, model.geom_quat[0])
    positions = model.mesh_vert @ turned.reshape(3, 3).T + model.geom_pos[0]
    uv = np.array(model.mesh_texcoord[: model.mesh_texcoordnum[0]], np.float32)
    corners = np.array(model.mesh_facetexcoord if len(uv) else np.zeros_like(model.mesh_face), np.int32)
    return TakenMesh(positions.astype(np.float32), np.array(model.mesh_face, np.int32), uv, corners)


def _stand_in_mesh(mesh: Any) -> None:
    mesh.file = mesh.content_type = ""
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_EXACT
    mesh.scale, mesh.refpos, mesh.refquat = [1, 1, 1], [0, 0, 0], [1, 0, 0, 0]
    mesh.uservert, mesh.userface = BOX, SIDES


def _count_pixels(png: bytes) -> int:
    """As its head says; none where it has none, of which MuJoCo says what is wrong."""
    if len(png) < 24:
        return 0
    width, height = struct.unpack(">II", png[16:24])
    return int(width * height)


def _compile_picture(picture: Any, path: str, content: bytes) -> NDArray[np.uint8]:
    spec = mujoco.MjSpec()
    alone = spec.add_texture(name=picture.name, file=path)
    for attribute in PICTURE_SAYS:
        setattr(alone, attribute, getattr(picture, attribute))
    spec.worldbody.add_geom(size=[1, 0, 0])
    model = _compile(spec, path, content)
    shape = (int(model.tex_height[0]), int(model.tex_width[0]), int(model.tex_nchannel[0]))
    return shrink_picture(model.tex_data.reshape(shape))


def _stand_in_picture(picture: Any) -> None:
    picture.file, picture.cubefiles, picture.content_type = "", NO_CUBE, ""
    picture.builtin, picture.mark = mujoco.mjtBuiltin.mjBUILTIN_FLAT, mujoco.mjtMark.mjMARK_NONE
    picture.gridsize, picture.gridlayout, picture.rgb1, picture.rgb2 = [1, 1], "", [1, 1, 1], [1, 1, 1]
    picture.width = picture.height = 1
    picture.nchannel = 3


def shrink_picture(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A copy whose sides are at most PICTURE_SIDE_MAX: each point the mean of those in its place."""
    high, wide = (-(-side // PICTURE_SIDE_MAX) for side in pixels.shape[:2])
    height, width = pixels.shape[0] // high, pixels.shape[1] // wide
    total = np.zeros((height, width, pixels.shape[2]), np.uint32)
    for row in range(high):
        for column in range(wide):
            total += pixels[row : height * high : high, column : width * wide : wide]
    mean: NDArray[np.uint8] = (total // (high * wide)).astype(np.uint8)
    return mean
