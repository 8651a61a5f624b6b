"""The motion as a small file; posecast_edge.sources.demo reads it.

A line `posecast-motion 1`, a line of JSON (rate, samples, fields with labels and scales, phases), then zlib
over all channels in order: int16 counts, differences from sample to sample modulo 2^16, first all low bytes
of the channel, then all high ones. -32768 is "no reading".
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping, Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from demo_robot.masses import Inertial
from demo_robot.robot import AXES, COLOURS, JOINTS, LINKS, ZERO, Visual, Xyz
from demo_robot.sensors import Field
from demo_robot.shapes import Mesh

MAGIC = b"posecast-motion 1\n"
MISSING = -32768


def pack(fields: Sequence[Field], rate_hz: int, phases: Sequence[tuple[float, str]]) -> bytes:
    """The file's bytes. ValueError when a value does not fit into int16 counts of its scale."""
    planes = []
    for field in fields:
        counts = np.round(field.values / field.scale)
        if np.nanmax(np.abs(counts)) > 32767:
            raise ValueError(f"{field.name}: {np.nanmax(np.abs(field.values)):g} does not fit its scale")
        whole = np.where(np.isnan(counts), MISSING, counts).astype(np.int64)
        step = np.diff(whole, axis=0, prepend=0).astype(np.uint16)
        for channel in step.T:
            planes += [(channel & 255).astype(np.uint8).tobytes(), (channel >> 8).astype(np.uint8).tobytes()]
    head = {
        "rate_hz": rate_hz,
        "samples": len(fields[0].values),
        "fields": [{"name": f.name, "labels": f.labels, "scale": f.scale} for f in fields],
        "phases": [list(p) for p in phases],
    }
    text = json.dumps(head, separators=(",", ":")).encode()
    return MAGIC + text + b"\n" + zlib.compress(b"".join(planes), 9)


# --- meshes

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


# --- the URDF


def urdf(visuals: Mapping[str, Sequence[Visual]], inertials: Mapping[str, Inertial]) -> str:
    """The robot as URDF text, its meshes at `meshes/STEM.stl` beside it."""
    lines = ['<?xml version="1.0" encoding="utf-8"?>', '<robot name="posecast_demo">']
    for name, rgb in COLOURS.items():
        rgba = " ".join(f"{c:g}" for c in (*rgb, 1))
        lines.append(f'  <material name={quoteattr(name)}><color rgba="{rgba}"/></material>')
    for link in LINKS:
        lines.append(f"  <link name={quoteattr(link)}>")
        lines += _inertial(inertials[link])
        for v in visuals.get(link, ()):
            lines.append("    <visual>")
            if v.xyz != ZERO or v.rpy != ZERO:
                lines.append(f"      {_origin(v.xyz, v.rpy)}")
            lines.append(f'      <geometry><mesh filename="meshes/{v.mesh}.stl"/></geometry>')
            lines.append(f"      <material name={quoteattr(v.colour)}/>")
            lines.append("    </visual>")
        lines.append("  </link>")
    for j in JOINTS:
        axis = " ".join(f"{c:g}" for c in AXES[j.axis])
        lines += [
            f'  <joint name={quoteattr(j.name)} type="revolute">',
            f"    <parent link={quoteattr(j.parent)}/><child link={quoteattr(j.child)}/>",
            f"    {_origin(j.xyz, j.rpy)}",
            f'    <axis xyz="{axis}"/>',
            f'    <limit lower="{j.low:g}" upper="{j.high:g}" effort="120" velocity="8"/>',
            "  </joint>",
        ]
    lines.append("</robot>")
    return "\n".join(lines) + "\n"


def _inertial(i: Inertial) -> list[str]:
    xyz = " ".join(f"{c:.6g}" for c in i.centre.round(6) + 0.0)
    terms = [
        f'i{"xyz"[r]}{"xyz"[c]}="{i.inertia[r, c].round(9) + 0.0:.6g}"' for r in range(3) for c in range(r, 3)
    ]
    return [
        "    <inertial>",
        f'      <origin xyz="{xyz}"/>',
        f'      <mass value="{i.mass_kg:g}"/>',
        f"      <inertia {' '.join(terms)}/>",
        "    </inertial>",
    ]


def _origin(xyz: Xyz, rpy: Xyz) -> str:
    return f'<origin xyz="{" ".join(f"{c:.6g}" for c in xyz)}" rpy="{" ".join(f"{c:.6g}" for c in rpy)}"/>'
