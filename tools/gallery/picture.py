"""Draws a built robot from its bundle alone, the data that a viewer has."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import meshoptimizer
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from posecast_edge.model.builder.manifest import compute_home
from posecast_edge.model.builder.thumbnail import FRONT_LEFT_ABOVE, draw_thumbnail
from posecast_edge.model.kinematics import compute_link_poses, matrix_from_quaternion

SIDE = 160  # pixels of one view
EYES = (np.array([1.0, 0.0, 0.0]), FRONT_LEFT_ABOVE)  # from the front, and three-quarter view
PAPER = (244, 245, 247)

Vectors = NDArray[np.float64]


def draw_robot(bundle: Path) -> Image.Image:
    """The robot at its home position: front and three-quarter views side by side."""
    manifest = json.loads((bundle / "manifest.json").read_text())
    level = manifest["levels"][min(1, len(manifest["levels"]) - 1)]  # the middle one if there is one
    triangles = read_triangles(manifest, (bundle / level["path"]).read_bytes())
    both = Image.new("RGB", (SIDE * len(EYES), SIDE), PAPER)
    for number, eye in enumerate(EYES):
        view = Image.fromarray(draw_thumbnail(*triangles, side=SIDE, eye=eye), "RGBA")
        both.paste(view, (SIDE * number, 0), view)
    return both


def read_triangles(
    manifest: Mapping[str, Any], glb: bytes, poses: Mapping[str, Any] | None = None
) -> tuple[Vectors, Vectors, Vectors]:
    """A level's triangles as a viewer sees them: corners and normals (m, 3, 3) in the root link, metres;
    display colours (m, 3). `poses`: root_from_link by name; None: the home position."""
    length = struct.unpack_from("<I", glb, 12)[0]
    document, binary = json.loads(glb[20 : 20 + length]), glb[28 + length :]
    poses = poses or compute_link_poses(manifest, compute_home(manifest))
    links = [np.array(poses[name]) for name in manifest["links"]]
    visuals = {v["node"]: v for v in manifest["visuals"]}
    views: dict[int, NDArray[Any]] = {}
    parts: list[tuple[Vectors, Vectors, Vectors]] = [(np.zeros((0, 3, 3)),) * 2 + (np.zeros((0, 3)),)]
    for node in document.get("nodes", []):
        if "mesh" not in node:
            continue
        visual = visuals[node["name"]]
        x, y, z, w = node.get("rotation", (0, 0, 0, 1))
        placed = np.array(matrix_from_quaternion(node.get("translation", (0, 0, 0)), (w, x, y, z)))
        at, scale = links[visual["link"]] @ placed, node["scale"][0]
        for primitive in document["meshes"][node["mesh"]]["primitives"]:
            faces = _read(document, binary, primitive["indices"], views).reshape(-1, 3)
            names = primitive["attributes"]
            points = _read(document, binary, names["POSITION"], views)[faces, :3] * scale
            normals = _read(document, binary, names["NORMAL"], views)[faces, :3] / 127.0
            colour = _colour(document["materials"][primitive["material"]], visual["color"])
            parts.append(
                (
                    points @ at[:3, :3].T + at[:3, 3],
                    normals @ at[:3, :3].T,
                    np.tile(colour, (len(faces), 1)),
                )
            )
    corners, normals, colours = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return corners, normals, colours


def _read(
    document: Mapping[str, Any], binary: bytes, number: int, views: dict[int, NDArray[Any]]
) -> NDArray[Any]:
    """An accessor's values: indices (n,) or rows with their padding."""
    accessor = document["accessors"][number]
    view = accessor["bufferView"]
    if view not in views:
        packed = document["bufferViews"][view]["extensions"]["EXT_meshopt_compression"]
        data = binary[packed["byteOffset"] : packed["byteOffset"] + packed["byteLength"]]
        if packed["mode"] == "TRIANGLES":
            views[view] = meshoptimizer.decode_index_buffer(packed["count"], packed["byteStride"], data)
        else:
            rows = meshoptimizer.decode_vertex_buffer(packed["count"], packed["byteStride"], data)
            kind = {5122: "<i2", 5120: "i1", 5126: "<f4"}[accessor["componentType"]]
            views[view] = np.ascontiguousarray(rows).view(kind).reshape(packed["count"], -1)
    if accessor["type"] != "SCALAR":
        return views[view]
    first = accessor.get("byteOffset", 0) // 4
    return views[view].reshape(-1)[first : first + accessor["count"]].astype(np.int64)


def _colour(material: Mapping[str, Any], mean: str) -> Vectors:
    """A paint's colour; for a textured one, the visual's mean."""
    pbr = material["pbrMetallicRoughness"]
    if "baseColorTexture" in pbr:
        return np.array([int(mean[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    return np.array(pbr["baseColorFactor"][:3]) ** (1 / 2.2)
