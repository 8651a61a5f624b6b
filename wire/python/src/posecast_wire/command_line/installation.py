"""Finds out what is installed, and how to add missing parts.

The functions import the modules for this themselves: these take 3 MB, which an agent on a robot never needs.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from importlib.metadata import Distribution

WHOLE = "posecast"  # the distribution that contains all the others
PART = "posecast-wire"


def find_version(program: str = PART) -> str:
    """Return the version of a program such as posecast-relay: that of `posecast`, which contains all of them,
    or else of the program's own distribution."""
    found = _find(WHOLE) or _find(program) or _find(PART)
    return "unknown" if found is None else found.version


def name_edge_command(command: str) -> str:
    """Return how a user runs a command of the agent, such as doctor.

    That is `posecast doctor` if `posecast` is installed (uvx can only start it by that name), otherwise
    `posecast-edge doctor`.
    """
    from importlib.util import find_spec  # noqa: PLC0415

    return f"posecast {command}" if find_spec("posecast_command") else f"posecast-edge {command}"


def advise_extra(part: str, extra: str) -> str:
    """Return the command that installs an extra.

    `part`: the distribution with this extra, such as posecast-edge; the whole distribution has the same
    extras. The command fits the environment: uv creates environments without pip, and uvx puts them outside
    the PATH.
    """
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
    """Return the wheel or folder that it was installed from, if that file still exists.

    The index that pip uses may not have our packages.
    """
    import json  # noqa: PLC0415
    from urllib.parse import unquote, urlparse  # noqa: PLC0415

    try:
        url = urlparse(json.loads(found.read_text("direct_url.json") or "{}").get("url", ""))
    except (ValueError, AttributeError):
        return None
    path = unquote(url.path)
    return path if url.scheme == "file" and Path(path).exists() else None
