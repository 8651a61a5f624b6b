"""`posecast-edge` with a built model (docs/MODEL.md) in the place of a URDF's raw files.

argv: the bundle's folder, then the arguments of `posecast-edge`, `--urdf` with any value among them.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

from posecast_edge import cli
from posecast_edge.model.bundle import Bundle, BundleFile


class BuiltBundle(Bundle):
    """The folder's manifest as it is, and the files it names."""

    def __init__(self, folder: Path) -> None:
        text = (folder / "manifest.json").read_bytes()
        files = [
            BundleFile(folder / f["path"], f["path"], f["path"], f["size"], f["sha256"])
            for f in json.loads(text)["files"]
        ]
        super().__init__(files, [])
        self.manifest = text
        self.hash = hashlib.sha256(text).hexdigest()


def main() -> None:
    """Runs the agent; ends the process."""
    folder = Path(sys.argv.pop(1))
    cli.load_bundle = lambda _urdf: BuiltBundle(folder)  # type: ignore[attr-defined]
    cli.main()


if __name__ == "__main__":
    main()
