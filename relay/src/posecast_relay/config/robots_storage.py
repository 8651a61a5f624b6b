"""Replaces the file of `--robots` in one step, so that a running relay never reads half of it."""

from __future__ import annotations

import contextlib
import fcntl
import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

from posecast_relay.config.robots_file import name_user
from posecast_relay.config.settings import SettingsError

BACKUP = ".bak"  # ends the name of the version before


@contextlib.contextmanager
def lock_folder(path: Path) -> Iterator[None]:
    """Hold a lock on the file's folder, so that no two commands change the file at once."""
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


def replace_text(path: Path, text: str, keep_before: bool = False) -> None:
    """Replace the text of the file. Its owner, group and mode stay, but others never may read it.

    A new file is for its owner alone, who is the folder's where root writes it. `keep_before`: the version
    before stays beside it as FILE.bak, if it can be read. Raises SettingsError where owner or group can't
    stay, since the relay could not read the file any more; OSError where it can't be written.
    """
    path = path.resolve()  # a link to it stays one
    before = path.stat() if path.exists() else None
    mode = 0o600 if before is None else stat.S_IMODE(before.st_mode) & 0o770
    owner = _find_owner(path, before)
    if keep_before and before is not None and os.access(path, os.R_OK):
        _place(Path(f"{path}{BACKUP}"), path.read_bytes(), mode, owner)
    _place(path, text.encode(), mode, owner)


def _find_owner(path: Path, before: os.stat_result | None) -> tuple[int, int]:
    """Return the user and group that the file is to have. Raises SettingsError."""
    folder = path.parent.stat()
    user = os.geteuid()
    if before is None:
        return (folder.st_uid, folder.st_gid) if user == 0 else (user, -1)
    if user in (0, before.st_uid):
        return before.st_uid, before.st_gid
    if user == folder.st_uid:  # the relay's own user; somebody else has put a file of theirs there
        return user, -1
    raise SettingsError(
        f"{path}: belongs to {name_user(before.st_uid)}, and would belong to {name_user(user)} afterwards: "
        "run this as its owner, or as root"
    )


def _place(path: Path, data: bytes, mode: int, owner: tuple[int, int]) -> None:
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        with contextlib.suppress(PermissionError):  # a group that this user is not of: checked below
            os.chown(temporary, *owner)
        if owner[1] not in (-1, Path(temporary).stat().st_gid):
            raise SettingsError(f"{path}: its group {owner[1]} can't stay: run this as root")
        Path(temporary).chmod(mode)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
