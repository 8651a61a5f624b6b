"""Third-party parts of the guide, with licences, in the form of the page's licenses.json."""

from __future__ import annotations

import json
import re
from importlib.metadata import files, metadata
from pathlib import Path
from typing import TypedDict

GENERATOR = "zensical"
ICONS = "zensical/templates/.icons/lucide/LICENSE"
SHIM = "node_modules/iframe-worker"
BUNDLED = re.compile(
    r"Package: (?P<name>\S+)@(?P<version>\S+)\nLicense: (?P<licence>\S+)\n(?P<text>(?:.+\n?)+)"
)
SPDX = {"W3C": "W3C-20150513"}  # SPDX identifiers for names that are not SPDX's own


class Notice(TypedDict):
    """One part: `identifier` is SPDX's, `purl` names it in a list of components, `text` is its notice."""

    name: str
    version: str
    identifier: str
    purl: str
    text: str


def list_notices(root: Path, bundle: str) -> list[Notice]:
    """All notices. `bundle`: the notice in the generator's script. Raises LookupError if one is missing."""
    generator = metadata(GENERATOR)
    version = generator["Version"]
    shim = json.loads((root / SHIM / "package.json").read_text(encoding="utf-8"))
    found = [
        _make_notice(GENERATOR, version, "MIT", "pypi", _read_installed("LICENSE.md")),
        _make_notice("lucide", f"in-{GENERATOR}-{version}", "ISC", "generic", _read_installed(ICONS)),
        _make_notice(
            shim["name"], shim["version"], shim["license"], "npm", (root / SHIM / "LICENSE").read_text()
        ),
    ]
    parts = list(BUNDLED.finditer(bundle))
    if not parts:
        raise LookupError("the generator's script lists no licences; did the version of Zensical change?")
    for part in parts:
        identifier = SPDX.get(part["licence"], part["licence"])
        found.append(_make_notice(part["name"], part["version"], identifier, "npm", part["text"].strip()))
    return found


def _make_notice(name: str, version: str, identifier: str, kind: str, text: str) -> Notice:
    purl = f"pkg:{kind}/{name.replace('@', '%40')}@{version}"
    return {"name": name, "version": version, "identifier": identifier, "purl": purl, "text": text}


def _read_installed(end: str) -> str:
    for file in files(GENERATOR) or ():
        if file.as_posix().endswith(end):
            return file.read_text(encoding="utf-8")
    raise LookupError(f"{GENERATOR} has no {end}; did its version change?")
