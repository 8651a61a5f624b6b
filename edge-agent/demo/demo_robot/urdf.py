"""The demo robot written down as a URDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.sax.saxutils import quoteattr

from demo_robot.masses import Inertial
from demo_robot.robot import AXES, COLOURS, JOINTS, LINKS, ZERO, Visual, Xyz


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
