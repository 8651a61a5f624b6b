"""Makes the demo robot: `build.py --out FOLDER` writes meshes/*.stl, motion.bin and robot.urdf.

Always the same bytes. The URDF comes last and each file in one move: who finds robot.urdf finds everything.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from demo_robot import body, masses, motion, packing, programme, sensors


def main() -> None:
    """Build into --out; files of an older build that are no longer made are removed."""
    parser = argparse.ArgumentParser(description="Makes the demo robot: shells, URDF, motion.")
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    out: Path = parser.parse_args().out
    meshes, visuals = body.build()
    files = {f"meshes/{stem}.stl": packing.stl_bytes(mesh) for stem, mesh in meshes.items()}
    inertials = masses.inertials(body.parts())
    minute = sensors.fields(motion.make(inertials), inertials)
    files["motion.bin"] = packing.pack(minute, motion.RATE_HZ, programme.PHASES)
    files["robot.urdf"] = packing.urdf(visuals, inertials).encode()
    (out / "meshes").mkdir(parents=True, exist_ok=True)
    for old in (out / "meshes").iterdir():
        if f"meshes/{old.name}" not in files:
            old.unlink()
    for name, content in files.items():
        part = out / f"{name}.part"
        part.write_bytes(content)
        os.replace(part, out / name)
    triangles = sum(len(mesh.faces) for mesh in meshes.values())
    motion_size, size = len(files["motion.bin"]), sum(map(len, files.values()))
    print(f"demo robot: {len(meshes)} meshes, {triangles} triangles, motion {motion_size} B, {size} B in all")


if __name__ == "__main__":
    main()
