"""Makes one distribution of the parts. It needs what they need, so that a version is pinned in one place; its
wheel contains their code and the built page, so that each of these is in the repository once."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

PARTS = ("wire/python", "edge-agent", "relay")
PAGE = "spa/dist"
OWN = (
    "segno==1.6.6",  # the QR code
    "shtab==1.13.0",  # completion in shells
)


class PartsMetadata(MetadataHookInterface):
    """Sets `dependencies` and `optional-dependencies`."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Collect what the parts need from elsewhere. No two of them have an extra of one name."""
        needed: set[str] = set(OWN)
        extras: dict[str, list[str]] = {}
        for part in PARTS:
            text = (Path(self.root).parent / part / "pyproject.toml").read_text(encoding="utf-8")
            project = tomllib.loads(text)["project"]
            needed |= {line for line in project.get("dependencies", ()) if not line.startswith("posecast-")}
            extras |= project.get("optional-dependencies", {})
        metadata["dependencies"] = sorted(needed)
        metadata["optional-dependencies"] = extras


class PartsInside(BuildHookInterface[Any]):
    """Puts the parts into the wheel; a workspace has each of them installed by itself."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Name the folders. OSError when the page has not been built."""
        if version == "editable":
            return
        repository = Path(self.root).parent
        packages = [package for part in PARTS for package in (repository / part / "src").iterdir()]
        inside = {str(package): package.name for package in packages if (package / "__init__.py").is_file()}
        inside[str((repository / PAGE).resolve(strict=True))] = "posecast_relay/page"
        build_data["force_include"].update(inside)
