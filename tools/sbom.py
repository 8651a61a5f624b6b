"""python -m tools.sbom DIST: writes an SBOM of each wheel (CycloneDX 1.5) beside it.

The Python part is uv's export of the lock file (names, versions, hashes of every file). Licences come from
the metadata of installed packages. The page's part is the list of what Vite bundled (spa/dist/licenses.json);
the guide's part comes from tools/site.
"""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
UV = ROOT / ".tools/bin/uv"
PAGE = ROOT / "spa/dist/licenses.json"
GUIDE = ROOT / "spa/dist/guide/licenses.json"
WITH_PAGE = ("posecast-relay", "posecast")
PARTS = ("posecast-wire", "posecast-edge", *WITH_PAGE)
# shipped unchanged, not bundled by Vite
AS_IT_COMES = ROOT / "node_modules/swagger-ui-dist/package.json"


def sbom(package: str) -> dict[str, Any]:
    """The SBOM of one wheel with all its extras. Raises OSError, subprocess.CalledProcessError."""
    words = ("export", "--quiet", "--frozen", "--no-dev", "--all-extras", "--format", "cyclonedx1.5")
    made = subprocess.run(
        [UV, *words, "--package", package], cwd=ROOT, capture_output=True, text=True, check=True
    )
    document: dict[str, Any] = json.loads(made.stdout)
    for component in document["components"]:
        known = licences(component["name"])
        if known:
            component["licenses"] = known
    if package in WITH_PAGE:
        _add_page(document)
    return document


def licences(distribution: str) -> list[dict[str, Any]]:
    """A distribution's licence from its metadata, in CycloneDX terms; [] if it is not installed here."""
    try:
        told = metadata(distribution)
    except PackageNotFoundError:  # for a different system
        return []
    if "License-Expression" in told:
        return [{"expression": told["License-Expression"]}]
    classified = [
        line.rpartition(" :: ")[2] for line in told.get_all("Classifier", []) if line.startswith("License ::")
    ]
    named = [name for name in classified if name != "OSI Approved"]
    text = told["License"].strip() if "License" in told else ""
    if not named and 0 < len(text) < 100:  # some put the licence name there
        named = [text]
    if not named and text:  # and some the full text, as xacro does
        return [{"license": {"name": f"as {distribution} says", "text": {"content": text}}}]
    return [{"license": {"name": name}} for name in named]


def _add_page(document: dict[str, Any]) -> None:
    bundled = json.loads(PAGE.read_text())
    other = json.loads(AS_IT_COMES.read_text())
    bundled.append({"name": other["name"], "version": other["version"], "identifier": other["license"]})
    known = {component["bom-ref"] for component in document["components"]}
    added = []
    for part in [*bundled, *json.loads(GUIDE.read_text())]:
        name, version = part["name"], part["version"]
        purl = part.get("purl") or f"pkg:npm/{name.replace('@', '%40')}@{version}"
        if purl in known:  # both the page and the guide have it
            continue
        known.add(purl)
        component = {"type": "library", "bom-ref": purl, "name": name, "version": version, "purl": purl}
        added.append(component | {"licenses": [{"expression": part["identifier"]}]})
    document["components"] += added
    own = document["metadata"]["component"]["bom-ref"]
    (node,) = (node for node in document["dependencies"] if node["ref"] == own)
    node["dependsOn"] = [*node.get("dependsOn", []), *(component["bom-ref"] for component in added)]
    document["dependencies"] += [{"ref": component["bom-ref"]} for component in added]


def main() -> None:
    """Write one file per wheel."""
    folder = Path(sys.argv[1])
    for package in PARTS:
        file = folder / f"{package}.cdx.json"
        document = sbom(package)
        file.write_text(json.dumps(document, indent=1) + "\n")
        print(f"{file}: {len(document['components'])} components")


if __name__ == "__main__":
    main()
