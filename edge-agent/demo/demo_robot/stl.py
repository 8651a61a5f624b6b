"""Binary STL."""

from __future__ import annotations

import numpy as np

from demo_robot.shapes import Mesh

TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def stl_bytes(mesh: Mesh) -> bytes:
    """A mesh as binary STL. Triangles without area are left out: no loader knows their normal."""
    corners = mesh.vertices[mesh.faces].astype("<f4")
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).astype(np.float64)
    length = np.linalg.norm(normal, axis=1)
    solid = length > 0
    triangles = np.zeros(int(solid.sum()), TRIANGLE)
    triangles["normal"] = normal[solid] / length[solid, None]
    triangles["corners"] = corners[solid]
    return b"posecast demo robot".ljust(80, b"\0") + np.uint32(len(triangles)).tobytes() + triangles.tobytes()
