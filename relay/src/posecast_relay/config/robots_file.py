"""The robots file (`--robots`) on disk: reads it, replaces it atomically, so that a running relay never reads
half of it, and watches it and its expiring credentials while the relay runs. See robots_reader.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import logging
import os
import pwd
import stat
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from pathlib import Path

from posecast_relay.config.robots_reader import Robots, RobotsError, parse_robots
from posecast_relay.config.settings import SettingsError

log = logging.getLogger("posecast_relay")

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


LOOK_S = 0.5
PAUSE_MAX = 16  # checks between two attempts to apply a change

FileState = tuple[int, int, int, int]


class RobotsWatcher:
    """Calls `changed` with the robots when they change, a credential expires, or one of the files `beside`
    (certificates) is replaced.

    If the file is invalid, unreadable, missing or empty (an editor has just begun to write it, or the disk
    is full), the last good version stays in force. The log has one line for each such change of the file, and
    one when the file is good again.

    If `changed` raises, it is called again, after pauses of up to PAUSE_MAX checks.
    """

    def __init__(
        self,
        path: Path,
        robots: Robots,
        changed: Callable[[Robots], Awaitable[None]],
        read: Callable[[Path], Robots] = read_robots,
        beside: Sequence[Path] = (),
    ) -> None:
        self.robots = robots
        self.refused = 0  # how often the file was invalid
        self.trouble: str | None = None  # the file's present error
        self.failure: str | None = None  # why the last change is not in force yet
        self._path = path
        self._changed = changed
        self._read = read
        self._seen: FileState | None = (0, 0, 0, 0)  # it may have changed since it was read: look again
        self._must_retry = False
        self._is_due = False  # a change is not in force yet
        self._pause = self._pauses = 0  # checks left until the next attempt; how long the last pause was
        self._beside = beside
        self._beside_taken = self._beside_seen = [_find_state(each) for each in beside]
        self._looked_s = time.time()

    async def run(self) -> None:
        """Check the files twice a second, until cancelled."""
        while True:
            await asyncio.sleep(LOOK_S)
            try:
                await self.check_file(time.time())
            except Exception as e:  # a bug in the relay: try again
                log.error("%s can't be watched", self._path, exc_info=e)

    async def check_file(self, unix_s: float) -> None:
        """Check the files once, and call `changed` if needed. `unix_s`: the present time in unix seconds."""
        before = self.robots
        has_expired = before.list_publishers(self._looked_s) != before.list_publishers(unix_s)
        self._looked_s = unix_s
        seen = _find_state(self._path)
        if seen != self._seen or self._must_retry:
            await self._reread(is_new=seen != self._seen)
            self._seen = seen
        if self._has_new_beside() or has_expired or self.robots != before:
            self._is_due, self._pause = True, 0
        if self._is_due and self._pause == 0:
            await self._apply()
        elif self._is_due:
            self._pause -= 1

    async def _apply(self) -> None:
        try:
            await self._changed(self.robots)
        except Exception as e:
            self._pause = self._pauses = min(2 * self._pauses + 1, PAUSE_MAX)
            if str(e) != self.failure:
                is_bug = not isinstance(e, OSError)
                log.error(
                    "%s: its last change is not in force: %s; retrying",
                    self._path,
                    repr(e) if is_bug else e,
                    exc_info=e if is_bug else None,
                )
            self.failure = str(e)
            return
        self._is_due, self._pauses = False, 0
        if self.failure is not None:
            self.failure = None
            log.warning("%s: its last change is in force", self._path)

    async def _reread(self, is_new: bool) -> None:
        try:
            self.robots = await asyncio.to_thread(self._read, self._path)
        except RobotsError as e:
            self._must_retry = isinstance(e, UnreadableError)
            if is_new or str(e) != self.trouble:
                self.refused += 1
                log.warning("%s; its last good version stays in force", e)
            self.trouble = str(e)
            return
        self._must_retry = False
        if self.trouble is not None:
            self.trouble = None
            log.warning("%s: is valid again", self._path)

    def _has_new_beside(self) -> bool:
        """Whether a file `beside` has a new version that has stayed the same for one check: a certificate and
        its key are written one after the other.
        """
        before, self._beside_seen = self._beside_seen, [_find_state(each) for each in self._beside]
        if self._beside_seen == self._beside_taken or self._beside_seen != before:
            return False
        self._beside_taken = self._beside_seen
        return True


def _find_state(path: Path) -> FileState | None:
    """Return a value that changes with the file's content, owner or mode; None if the file is missing."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino, found.st_ctime_ns
