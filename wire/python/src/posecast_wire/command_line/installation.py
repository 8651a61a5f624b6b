"""What is installed here, and how what is missing can be added to it."""

from __future__ import annotations

import json
import shlex
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from urllib.parse import unquote, urlparse

WHOLE = "posecast"  # the distribution that contains all the others
PART = "posecast-wire"


def find_version() -> str:
    """The version of the programs; they are released together."""
    found = _find(WHOLE) or _find(PART)
    return "unknown" if found is None else found.version


def advise_extra(part: str, extra: str) -> str:
    """The command that adds an extra to what is installed. `part`: the distribution whose extra it is, such
    as posecast-edge; where the whole is installed, it has the extra too."""
    found = _find(WHOLE) or _find(part)
    where = None if found is None else _locate(found) or found.name
    return f"pip install {shlex.quote(f'{where or part}[{extra}]')}"


def _find(name: str) -> Distribution | None:
    try:
        return distribution(name)
    except PackageNotFoundError:
        return None


def _locate(found: Distribution) -> str | None:
    """The wheel or folder it was installed from, when that is a file that is still there; nothing of ours may
    be at the index that pip asks."""
    try:
        url = urlparse(json.loads(found.read_text("direct_url.json") or "{}").get("url", ""))
    except (ValueError, AttributeError):
        return None
    path = unquote(url.path)
    return path if url.scheme == "file" and Path(path).exists() else None
