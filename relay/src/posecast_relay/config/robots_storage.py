"""Replaces the file of `--robots` in one step, so that a running relay never reads half of it."""

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

BACKUP = ".bak"  # ends the name of the version before
LOCK_S = 10.0  # a command holds the lock for milliseconds
LOCK_LOOK_S = 0.02


@contextlib.contextmanager
def lock_folder(path: Path, wait_s: float = LOCK_S) -> Iterator[None]:
    """Hold a lock on the folder of the file, or of what a link there leads to, so that no two commands change
    the file at once.

    Raises SettingsError where another one holds it for over `wait_s` seconds; OSError where the folder can't
    be opened.
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
                        f"{path}: another command is changing it, for over {wait_s:g} s"
                    ) from None
                time.sleep(LOCK_LOOK_S)
        yield
    finally:
        os.close(folder)


def replace_text(path: Path, text: str, keep_before: bool = False) -> None:
    """Replace the text of the file, whose folder the caller has locked. Its owner, group and mode stay, but
    others never may read it.

    A new file is for its owner alone, who is the folder's where root writes it. `keep_before`: the version
    before stays beside it as FILE.bak, if it can be read and is no larger than the file may be.

    Raises SettingsError where owner or group can't stay, since the relay could not read the file any more;
    OSError where it can't be written.
    """
    path = _follow_links(path)  # a link to it stays one
    before = path.stat() if path.exists() else None
    mode = 0o600 if before is None else stat.S_IMODE(before.st_mode) & 0o770
    owner = _find_owner(path, before)
    if keep_before and before is not None and _is_worth_keeping(path, before):
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


def _follow_links(path: Path) -> Path:
    return Path(os.path.realpath(path))  # Path.resolve() may raise RuntimeError where links lead in a circle


def _is_worth_keeping(path: Path, before: os.stat_result) -> bool:
    is_file = stat.S_ISREG(before.st_mode)  # to read a pipe would wait for its other end
    return is_file and before.st_size <= BYTES_MAX and os.access(path, os.R_OK)


def _place(path: Path, data: bytes, mode: int, owner: tuple[int, int]) -> None:
    temporary = path.with_name(f".{path.name}.new")
    temporary.unlink(missing_ok=True)  # of a command that was killed
    handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
    try:
        with os.fdopen(handle, "wb") as file:
            # Owner and mode by the handle: the folder's user, whom root may work for, can put a link to any
            # other file in the place of the name.
            with contextlib.suppress(PermissionError):  # a group that this user is not of: checked below
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
