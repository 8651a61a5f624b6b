"""Reads the geoms of a compiled MuJoCo model as visuals, with meshes and colours."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.finding import Finding
from posecast_edge.model.kinematics import matrix_from_quaternion
from posecast_edge.model.meshes.mesh import Mesh, Paint, Rgba, Surface, validate_mesh
from posecast_edge.model.mjcf.bodies import normalise_quaternion
from posecast_edge.model.mjcf.compiled import PICTURE_PIXELS_MAX, CompiledModel
from posecast_edge.model.sdf.frames import make_pose
from posecast_edge.model.urdf.types import ONES, Geometry, Material, Shape

PLANE, HFIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH, SDF = range(9)  # mjtGeom
GROUPS = 6
GROUPS_SHOWN = 3  # MuJoCo's viewer shows geoms of groups 0, 1 and 2
DEFAULT_RGBA = (0.5, 0.5, 0.5, 1.0)  # a geom's own, which its material's goes before
PICTURE = 0  # mjtTexture: one picture, not the six of a cube
PICTURE_ROLES = (1, 8)  # mjtTextureRole: RGB, RGBA


class GeomReader:
    """Makes visuals of geoms. `meshes`: those that they name, by URI."""

    def __init__(self, model: CompiledModel) -> None:
        self._model = model
        self.meshes: dict[str, Mesh] = {}
        self.findings: list[Finding] = []
        self._pictures: dict[int, bytes | None] = {}
        self._means: dict[int, tuple[float, float, float]] = {}
        self._kinds = model["geom_type"].tolist()
        self._bodies = model["geom_bodyid"].tolist()
        self._paints = [self._rgba(i) for i in range(len(self._kinds))]

    def make_shapes(self, bodies: Mapping[int, str]) -> dict[int, list[Shape]]:
        """The visuals of these bodies, by number. What belongs to the world itself (floors, walls) only where
        there is nothing else."""
        shown = self._select([i for i, b in enumerate(self._bodies) if b in bodies and b != 0])
        if not shown and 0 in bodies:
            shown = self._select([i for i, b in enumerate(self._bodies) if b == 0])
        found: dict[int, list[Shape]] = {}
        for i in shown:
            found.setdefault(self._bodies[i], []).append(self._shape(i))
        return found

    def _select(self, geoms: Sequence[int]) -> list[int]:
        """Those that MuJoCo's viewer shows; where these are on less than half of the bodies, of as many of
        the groups that it hides as it takes."""
        for kind, name in ((PLANE, "planes"), (HFIELD, "height fields")):
            count = sum(self._kinds[i] == kind for i in geoms)
            if count:
                self._say("geom-skipped", f"{count} {name} on bodies: not shown")
        seen = [i for i in geoms if self._kinds[i] not in (PLANE, HFIELD) and self._paints[i][3] > 0]
        groups = self._model["geom_group"].tolist()
        bodies = {self._bodies[i] for i in seen}
        for last in range(GROUPS_SHOWN - 1, GROUPS):
            shown = [i for i in seen if groups[i] <= last]
            if 2 * len({self._bodies[i] for i in shown}) >= len(bodies):
                break
        if last >= GROUPS_SHOWN:
            text = f"groups 0 to 2, which MuJoCo's viewer shows, are almost empty; showing 0 to {last}"
            self._say("geom-groups", text)
        elif len(shown) < len(seen):
            text = f"{len(seen) - len(shown)} geoms of groups 3 to 5 are hidden, as in MuJoCo's viewer"
            self._say("geom-groups", text)
        return self._without_collisions(shown, groups)

    def _without_collisions(self, geoms: list[int], groups: Sequence[int]) -> list[int]:
        """Many models have shapes to look at in one group and shapes to collide with in another."""
        model = self._model
        collides = (model["geom_contype"] != 0) | (model["geom_conaffinity"] != 0)
        looks, bumps = set[int](), set[int]()
        for group in {groups[i] for i in geoms}:
            members = [i for i in geoms if groups[i] == group]
            if all(collides[i] for i in members):
                bumps.add(group)
            elif not any(collides[i] for i in members) and any(self._kinds[i] == MESH for i in members):
                looks.add(group)
        dressed = {self._bodies[i] for i in geoms if groups[i] in looks}
        bare = {self._bodies[i] for i in geoms if groups[i] in bumps}
        if not bare or 2 * len(bare & dressed) < len(bare):
            return geoms
        kept = [i for i in geoms if groups[i] not in bumps]
        count, which = len(geoms) - len(kept), ", ".join(map(str, sorted(bumps)))
        text = f"{count} geoms of group {which} are for collisions and are hidden; the visuals are in group"
        self._say("geom-groups", f"{text} {', '.join(map(str, sorted(looks)))}")
        return kept

    def _say(self, code: str, text: str) -> None:
        self.findings.append(Finding("hint", code, text))

    def _shape(self, i: int) -> Shape:
        model, line = self._model, self._model.lines["geom"][i]
        quat = normalise_quaternion(model["geom_quat"][i])
        pose = make_pose(matrix_from_quaternion(model["geom_pos"][i].tolist(), quat))
        geometry, painted = self._geometry(i, line)
        material = None if painted else Material("", self._paints[i], None, line)
        return Shape(pose, geometry, material, line)

    def _geometry(self, i: int, line: int) -> tuple[Geometry, bool]:
        """Its geometry, and whether that brings its own paint."""
        kind, mesh = self._kinds[i], int(self._model["geom_dataid"][i])
        a, b, c = (float(v) for v in self._model["geom_size"][i])
        if kind in (MESH, SDF):
            uri, painted = self._mesh(mesh, int(self._model["geom_matid"][i]), self._paints[i])
            return Geometry("mesh", (), uri, ONES, line), painted
        if kind == BOX:
            return Geometry("box", (2 * a, 2 * b, 2 * c), "", ONES, line), False
        if kind in (CAPSULE, CYLINDER):
            name = "capsule" if kind == CAPSULE else "cylinder"
            return Geometry(name, (a, 2 * b), "", ONES, line), False
        if kind == ELLIPSOID:
            most = max(a, b, c)
            return Geometry("sphere", (most,), "", (a / most, b / most, c / most), line), False
        return Geometry("sphere", (a,), "", ONES, line), False

    # ---- meshes ----

    def _mesh(self, mesh: int, material: int, rgba: Rgba) -> tuple[str, bool]:
        model, name = self._model, self._model.names["mesh"][mesh]
        uv = int(model["mesh_texcoordnum"][mesh]) > 0
        texture = self._texture_of(material) if uv else -1
        picture = self._picture(texture) if texture >= 0 else None
        uri = name if picture is None else f"{name} {material}"
        if uri not in self.meshes:
            paint = None
            if picture is not None:
                r, g, b = (float(v) for v in model["mat_rgba"][material][:3])
                paint = Paint((r, g, b, rgba[3]), picture)
            self.meshes[uri] = validate_mesh(Mesh((self._surface(mesh, paint),)))
        return uri, picture is not None

    def _surface(self, mesh: int, paint: Paint | None) -> Surface:
        model = self._model
        positions = _part(model["mesh_vert"], model["mesh_vertadr"][mesh], model["mesh_vertnum"][mesh])
        first, count = int(model["mesh_faceadr"][mesh]), int(model["mesh_facenum"][mesh])
        faces = _part(model["mesh_face"], first, count)
        if paint is None:
            return Surface(positions, faces)
        corners = _part(model["mesh_facetexcoord"], first, count).reshape(-1)
        uv = _part(model["mesh_texcoord"], model["mesh_texcoordadr"][mesh], model["mesh_texcoordnum"][mesh])
        own = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
        return Surface(positions[faces.reshape(-1)], own, uv[corners], paint)

    # ---- colours ----

    def _rgba(self, i: int) -> Rgba:
        """The colour a geom has by itself, by its material and by the mean of its texture."""
        material = int(self._model["geom_matid"][i])
        r, g, b, a = (float(v) for v in self._model["geom_rgba"][i])
        if material >= 0:
            if (r, g, b, a) == DEFAULT_RGBA:
                r, g, b, a = (float(v) for v in self._model["mat_rgba"][material])
            texture = self._texture_of(material)
            if texture >= 0:
                x, y, z = self._mean(texture)
                r, g, b = r * x, g * y, b * z
        r, g, b, a = (min(max(v, 0.0), 1.0) for v in (r, g, b, a))
        return (r, g, b, a)

    def _texture_of(self, material: int) -> int:
        """Of a material; -1 when there is none."""
        if material < 0:
            return -1
        roles = self._model["mat_texid"][material]
        return next((int(roles[role]) for role in PICTURE_ROLES if roles[role] >= 0), -1)

    def _pixels(self, texture: int) -> NDArray[np.uint8]:
        """(height, width, channels)."""
        model = self._model
        shape = [int(model[f"tex_{side}"][texture]) for side in ("height", "width", "nchannel")]
        if min(shape) < 1 or shape[2] > 4:
            raise ValueError("no picture")
        pixels: NDArray[Any] = _part(model["tex_data"], model["tex_adr"][texture], int(np.prod(shape)))
        return pixels.reshape(shape)

    def _mean(self, texture: int) -> tuple[float, float, float]:
        if texture not in self._means:
            mean = self._pixels(texture).mean((0, 1)) / 255
            values = [float(v) for v in mean[:3]] if len(mean) >= 3 else [float(mean[0])] * 3
            self._means[texture] = (values[0], values[1], values[2])
        return self._means[texture]

    def _picture(self, texture: int) -> bytes | None:
        """As PNG; None where it is no picture that meshes can have."""
        if texture not in self._pictures:
            self._pictures[texture] = self._encode(texture)
        return self._pictures[texture]

    def _encode(self, texture: int) -> bytes | None:
        pixels = self._pixels(texture)
        modes = {3: "RGB", 4: "RGBA"}
        if (
            int(self._model["tex_type"][texture]) != PICTURE
            or pixels.shape[2] not in modes
            or pixels.shape[0] * pixels.shape[1] > PICTURE_PIXELS_MAX
        ):
            return None
        try:
            from PIL import Image  # noqa: PLC0415 - of another extra
        except ImportError:
            return None
        out = io.BytesIO()
        size = (pixels.shape[1], pixels.shape[0])
        Image.frombytes(modes[pixels.shape[2]], size, pixels.tobytes()).save(out, "PNG", compress_level=1)
        return out.getvalue()


def _part(values: NDArray[Any], first: int, count: int) -> NDArray[Any]:
    """ValueError when it does not lie within."""
    if not 0 <= first <= first + count <= len(values):
        raise ValueError("beyond its array")
    return values[int(first) : int(first) + int(count)]
