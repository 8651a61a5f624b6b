"""Reads the robots file (`--robots`), which decides who can publish and who can watch. See robots_reader."""

from __future__ import annotations

import os
import pwd
import stat
from pathlib import Path

from posecast_relay.config.robots_reader import Robots, RobotsError, parse_robots

BYTES_MAX = 4_000_000


class UnreadableError(RobotsError):
    """The file can't be read. It may become readable later without a change of its content."""


def read_robots(path: Path, has_store: bool = True) -> Robots:
    """Read and check the file. Raises RobotsError if it can't be read, is invalid, or everybody may read it.

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
        raise RobotsError(f"{path}: contains secrets, but everybody on this machine can read it: chmod 600")
    if len(raw) > BYTES_MAX:
        raise RobotsError(f"{path}: over {BYTES_MAX} bytes")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise RobotsError(f"{path}: not UTF-8") from None


def _read_bytes(path: Path) -> tuple[bytes, int]:
    """Return the file's content, up to one byte over the limit, and its mode. Raises OSError, and
    UnreadableError if it is not a regular file.
    """
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # otherwise opening a pipe waits for a writer
    try:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            raise UnreadableError(f"{path}: is {'a folder' if stat.S_ISDIR(found.st_mode) else 'not a file'}")
        with open(handle, "rb", closefd=False) as file:
            return file.read(BYTES_MAX + 1), found.st_mode
    finally:
        os.close(handle)


def _explain(path: Path, error: OSError) -> str:
    """Say who owns the file, and what to do, if permissions are the reason why it can't be read."""
    if not isinstance(error, PermissionError):
        return ""
    try:
        found = path.stat()
    except OSError:
        return f": {name_user(os.geteuid())} may not enter its folder"
    return (
        f": it belongs to {name_user(found.st_uid)}, mode {stat.S_IMODE(found.st_mode):04o}, and this "
        f"process runs as {name_user(os.geteuid())}: chown it, or replace it with "
        "`posecast-relay robots edit --yes < FILE`"
    )


def name_user(uid: int) -> str:
    """Return the name and number of a user; only the number if it has no name, as in most containers."""
    try:
        return f"{pwd.getpwuid(uid).pw_name} (uid {uid})"
    except KeyError:
        return f"uid {uid}"
