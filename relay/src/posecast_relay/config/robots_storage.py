"""Replaces the robots file atomically, so that a running relay never reads half of it."""

from __future__ import annotations

import contextlib
import fcntl
import os
import stat
import time
from collections.abc import Iterator
from pathlib import Path

from posecast_relay.config.robots_file import BYTES_MAX, name_user
from posecast_relay.config.settings import SettingsError

BACKUP = ".bak"  # suffix of the previous version
LOCK_S = 10.0  # a command holds the lock for milliseconds
LOCK_LOOK_S = 0.02


@contextlib.contextmanager
def lock_folder(path: Path, wait_s: float = LOCK_S) -> Iterator[None]:
    """Hold a lock on the file's folder (links are followed), so that no two commands change the file at once.

    Raises SettingsError if another command holds the lock for over `wait_s` seconds; OSError if the folder
    can't be opened.
    """
    folder = os.open(_follow_links(path).parent, os.O_RDONLY)
    try:
        give_up_at = time.monotonic() + wait_s
        while True:
            try:
                fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() >= give_up_at:
                    raise SettingsError(
                        f"{path}: another command has been changing it for over {wait_s:g} s"
                    ) from None
                time.sleep(LOCK_LOOK_S)
        yield
    finally:
        os.close(folder)


def replace_text(path: Path, text: str, keep_before: bool = False) -> None:
    """Replace the text of the file; the caller has locked its folder. Owner, group and mode stay, but other
    users never get access.

    Only the owner can read a new file; if root writes it, the owner is the folder's. `keep_before`: keep the
    previous version as FILE.bak, if it is readable and within the size limit.

    Raises SettingsError if owner or group can't stay, because the relay could no longer read the file;
    OSError if it can't be written.
    """
    path = _follow_links(path)  # a link to the file stays a link
    before = path.stat() if path.exists() else None
    mode = 0o600 if before is None else stat.S_IMODE(before.st_mode) & 0o770
    owner = _find_owner(path, before)
    if keep_before and before is not None and _is_worth_keeping(path, before):
        _place(Path(f"{path}{BACKUP}"), path.read_bytes(), mode, owner)
    _place(path, text.encode(), mode, owner)


def _find_owner(path: Path, before: os.stat_result | None) -> tuple[int, int]:
    """Return the user and group of the new file. Raises SettingsError."""
    folder = path.parent.stat()
    user = os.geteuid()
    if before is None:
        return (folder.st_uid, folder.st_gid) if user == 0 else (user, -1)
    if user in (0, before.st_uid):
        return before.st_uid, before.st_gid
    if user == folder.st_uid:  # the relay's own user; another user has put a file there
        return user, -1
    raise SettingsError(
        f"{path}: belongs to {name_user(before.st_uid)}, and would belong to {name_user(user)} afterwards: "
        "run this as its owner, or as root"
    )


def _follow_links(path: Path) -> Path:
    return Path(os.path.realpath(path))  # Path.resolve() may raise RuntimeError on circular links


def _is_worth_keeping(path: Path, before: os.stat_result) -> bool:
    is_file = stat.S_ISREG(before.st_mode)  # reading a pipe would wait for its writer
    return is_file and before.st_size <= BYTES_MAX and os.access(path, os.R_OK)


def _place(path: Path, data: bytes, mode: int, owner: tuple[int, int]) -> None:
    temporary = path.with_name(f".{path.name}.new")
    temporary.unlink(missing_ok=True)  # left by a command that was killed
    handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
    try:
        with os.fdopen(handle, "wb") as file:
            # Set owner and mode through the handle: if root runs this, the folder's user could replace the
            # name with a link to any other file.
            with contextlib.suppress(PermissionError):  # this user is not in that group: checked below
                os.fchown(handle, *owner)
            if owner[1] not in (-1, os.fstat(handle).st_gid):
                raise SettingsError(f"{path}: its group {owner[1]} can't stay: run this as root")
            os.fchmod(handle, mode)
            file.write(data)
            file.flush()
            os.fsync(handle)
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
