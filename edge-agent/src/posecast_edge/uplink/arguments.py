"""Checks the arguments for the link: the relay's endpoint, and the file with the robot's credential."""

from __future__ import annotations

import re
import stat
from codecs import BOM_UTF8
from pathlib import Path

from posecast_wire.credential import LINE_MAX, Credential

from posecast_edge.kit import quote
from posecast_edge.uplink.credential_file import CredentialFile

ENDPOINT = re.compile(r"(tcp|tls|quic)/(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})")


def check_endpoint(text: str) -> str:
    """Return `text` if it is a relay's endpoint, `tcp/HOST:PORT`. Raises ValueError, one line, otherwise."""
    match = ENDPOINT.fullmatch(text)
    if not match or not 0 < int(match[3]) < 65536:
        raise ValueError(f"{quote(text)} is not an endpoint such as tcp/127.0.0.1:7447")
    return text


def read_credential(path: str) -> CredentialFile:
    """Read a file with the line that `posecast-relay robots add` printed. Raises ValueError when the file
    can't be read, is readable by everybody or holds no credential; its one line never holds the secret."""
    try:
        with Path(path).open("rb") as file:
            if stat.S_IMODE(Path(path).stat().st_mode) & 0o007:
                raise ValueError("readable by everybody on this machine: chmod 600 it")
            content = file.read(LINE_MAX + len(BOM_UTF8) + 1).removeprefix(BOM_UTF8)
            found = Credential.parse(content.decode("ascii", "replace"))
            return CredentialFile(found.robot, found.secret, found.ca, Path(path))
    except OSError as e:
        raise ValueError(f"{path}: {(e.strerror or str(e)).lower()}") from None
    except ValueError as e:
        raise ValueError(f"{path}: {e}") from None
