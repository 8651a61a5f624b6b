"""Forward kinematics by yourdfpy, independent of the page's: link → 4×4 matrix, as JSON.

stdin: `{"urdf": path, "joints": [{joint: rad or m, or null}, …], "base": null | {"xyz": [x, y, z],
"quat_wxyz": [w, x, y, z]}}`. stdout: `[{link: 16 numbers, row-major}, …]`; metres, world Z up. Without a
base, the robot's root is upright and the lowest point of the pose is at z = 0. Joints not named are at 0.
"""

from __future__ import annotations

import io
import itertools
import json
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import trimesh
import yourdfpy

Matrix = np.ndarray[Any, np.dtype[np.float64]]


def load(path: Path, meshes: bool) -> yourdfpy.URDF:
    """The URDF with its meshes searched beside it, whatever package their URIs name."""

    def find(fname: str, **_: object) -> str:
        tail = Path(fname.split("://", 1)[-1]).parts
        for skip in range(len(tail)):
            candidate = path.parent.joinpath(*tail[skip:])
            if candidate.exists():
                return str(candidate)
        return str(path.parent / fname)

    tree = ElementTree.parse(path)
    for link in tree.iter("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            geometry = part.find("geometry")
            # yourdfpy refuses a visual without a shape (Hubo 2+ has one); the page shows nothing there
            if part.tag == "collision" or geometry is None or len(geometry) == 0:
                link.remove(part)
    text = io.BytesIO(ElementTree.tostring(tree.getroot()))
    return yourdfpy.URDF.load(text, filename_handler=find, load_meshes=meshes, build_scene_graph=True)


def lowest_z_m(urdf: yourdfpy.URDF) -> float:
    """The lowest corner of all links' boxes, metres in the root's coordinates; boxes lie along links' axes.

    Boxes, not vertices, as on the page; for flat feet both are the same.
    """
    scene = urdf.scene
    boxes: dict[str, list[Matrix]] = {}
    for node in scene.graph.nodes_geometry:
        link = scene.graph.transforms.parents[node]
        link_from_mesh, name = scene.graph.get(node, frame_from=link)
        boxes.setdefault(link, []).append(
            trimesh.transform_points(scene.geometry[name].vertices, link_from_mesh)
        )
    lowest = np.inf
    for link, parts in boxes.items():
        extremes = [np.vstack(parts).min(axis=0), np.vstack(parts).max(axis=0)]
        corners = np.array(list(itertools.product(*np.transpose(extremes))))
        lowest = min(lowest, trimesh.transform_points(corners, urdf.get_transform(link))[:, 2].min())
    return 0.0 if np.isinf(lowest) else float(lowest)


def world_from_root(base: dict[str, list[float]] | None, urdf: yourdfpy.URDF) -> Matrix:
    """The root's pose: as reported, or on the floor."""
    pose = np.eye(4)
    if base is None:
        pose[2, 3] = -lowest_z_m(urdf)
        return pose
    w, x, y, z = base["quat_wxyz"]
    pose[:3, :3] = [  # the rotation of a unit quaternion
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = base["xyz"]
    return pose


def poses(
    urdf: yourdfpy.URDF, given: dict[str, float | None], base: dict[str, list[float]] | None
) -> dict[str, list[float]]:
    """world_from_link of every link in one configuration."""
    movable = set(urdf.actuated_joint_names)
    joints = {name: np.float64(value) for name, value in given.items() if value is not None}
    at_rest = dict.fromkeys(movable, np.float64(0))
    urdf.update_cfg(at_rest | {name: joints[name] for name in movable & joints.keys()})
    root = world_from_root(base, urdf)
    return {name: (root @ urdf.get_transform(name)).flatten().tolist() for name in urdf.link_map}


def main() -> None:
    """One robot in some poses."""
    given = json.load(sys.stdin)
    urdf = load(Path(given["urdf"]), meshes=given["base"] is None)
    json.dump([poses(urdf, joints, given["base"]) for joints in given["joints"]], sys.stdout)


if __name__ == "__main__":
    main()
