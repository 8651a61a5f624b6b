"""What is installed here, and how what is missing can be added to it.

What looks that up is imported by the functions: it takes 3 MB, which an agent beside a robot never needs.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from importlib.metadata import Distribution

WHOLE = "posecast"  # the distribution that contains all the others
PART = "posecast-wire"


def find_version() -> str:
    """The version of the programs; they are released together."""
    found = _find(WHOLE) or _find(PART)
    return "unknown" if found is None else found.version


def name_edge_command(command: str) -> str:
    """What a user types for a command of the agent, such as doctor: `posecast doctor` where `posecast` is
    installed, which uvx starts by that name alone, else `posecast-edge doctor`."""
    from importlib.util import find_spec  # noqa: PLC0415

    return f"posecast {command}" if find_spec("posecast_command") else f"posecast-edge {command}"


def advise_extra(part: str, extra: str) -> str:
    """The command that adds an extra to what is installed. `part`: the distribution whose extra it is, such
    as posecast-edge; where the whole is installed, it has the extra too. An environment that uv has made has
    no pip, and one of uvx is not on the PATH."""
    import shlex  # noqa: PLC0415

    found = _find(WHOLE) or _find(part)
    where = None if found is None else _locate(found) or found.name
    words = ["pip", "install"]
    if found is not None and (found.read_text("INSTALLER") or "").strip() == "uv":
        words = ["uv", *words, "--python", sys.executable]
    return shlex.join([*words, f"{where or part}[{extra}]"])


def _find(name: str) -> Distribution | None:
    from importlib.metadata import PackageNotFoundError, distribution  # noqa: PLC0415

    try:
        return distribution(name)
    except PackageNotFoundError:
        return None


def _locate(found: Distribution) -> str | None:
    """The wheel or folder it was installed from, when that is a file that is still there; nothing of ours may
    be at the index that pip asks."""
    import json  # noqa: PLC0415
    from urllib.parse import unquote, urlparse  # noqa: PLC0415

    try:
        url = urlparse(json.loads(found.read_text("direct_url.json") or "{}").get("url", ""))
    except (ValueError, AttributeError):
        return None
    path = unquote(url.path)
    return path if url.scheme == "file" and Path(path).exists() else None
