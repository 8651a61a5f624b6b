"""Reads the file of `--robots`, which says who may publish and who may watch what. See robots_reader."""

from __future__ import annotations

import os
import pwd
import stat
from pathlib import Path

from posecast_relay.config.robots_reader import Robots, RobotsError, parse_robots

BYTES_MAX = 4_000_000


class UnreadableError(RobotsError):
    """The file can't be read: it may be readable a moment later, with nothing changed in it."""


def read_robots(path: Path, has_store: bool = True) -> Robots:
    """Read and check the file. Raises RobotsError if it can't be read, is wrong, or is open to everybody.

    `has_store`: see parse_robots.
    """
    text = read_text(path)
    try:
        return parse_robots(text, has_store)
    except RobotsError as e:
        raise RobotsError(*(f"{path}: {mistake}" for mistake in e.mistakes)) from None


def read_text(path: Path) -> str:
    """Return the text of the file. Raises RobotsError if it can't be read, or everybody may read it."""
    try:
        raw, mode = _read_bytes(path)
    except OSError as e:
        raise UnreadableError(f"{path}: {(e.strerror or str(e)).lower()}{_explain(path, e)}") from None
    if mode & 0o007:
        raise RobotsError(f"{path}: holds secrets, and everybody on this machine may read it: chmod 600")
    if len(raw) > BYTES_MAX:
        raise RobotsError(f"{path}: over {BYTES_MAX} bytes")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise RobotsError(f"{path}: not UTF-8") from None


def _read_bytes(path: Path) -> tuple[bytes, int]:
    """Return what the file holds, up to one byte more than it may, and its mode. Raises OSError, and
    UnreadableError where it is no file.
    """
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # else opening a pipe waits for its other end
    try:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            raise UnreadableError(f"{path}: is {'a folder' if stat.S_ISDIR(found.st_mode) else 'no file'}")
        with open(handle, "rb", closefd=False) as file:
            return file.read(BYTES_MAX + 1), found.st_mode
    finally:
        os.close(handle)


def _explain(path: Path, error: OSError) -> str:
    """Say whose the file is, where that is why it can't be read, and how that is mended."""
    if not isinstance(error, PermissionError):
        return ""
    try:
        found = path.stat()
    except OSError:
        return f": {name_user(os.geteuid())} may not enter its folder"
    return (
        f": it belongs to {name_user(found.st_uid)}, mode {stat.S_IMODE(found.st_mode):04o}, and this is "
        f"{name_user(os.geteuid())}: chown it, or replace it by `posecast-relay robots edit --yes < FILE`"
    )


def name_user(uid: int) -> str:
    """Name a user of this machine; by number where it has no name, as in most containers."""
    try:
        return f"{pwd.getpwuid(uid).pw_name} (uid {uid})"
    except KeyError:
        return f"uid {uid}"
