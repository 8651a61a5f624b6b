"""Builds one distribution from all parts. It takes its dependencies from theirs, so each version is pinned in
one place. Its wheel contains their code and the built page, so the repository holds no copies."""

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
        """Collect the parts' third-party dependencies. No two parts have an extra with the same name."""
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
    """Puts the parts into the wheel. In a workspace each part is installed separately."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """List the folders to include. Raises OSError when the page has not been built."""
        if version == "editable":
            return
        repository = Path(self.root).parent
        packages = [package for part in PARTS for package in (repository / part / "src").iterdir()]
        inside = {str(package): package.name for package in packages if (package / "__init__.py").is_file()}
        inside[str((repository / PAGE).resolve(strict=True))] = "posecast_relay/page"
        build_data["force_include"].update(inside)
