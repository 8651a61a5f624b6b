"""A small port to object stores: a folder (`file:///…`), S3 (`s3://…`), Google (`gs://…`), Azure (`az://…`).

A URL gives the location. Credentials come from the environment, as obstore (Rust's object_store) reads it:
`AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY`, `AWS_REGION`, and `AWS_ENDPOINT_URL` for other S3 services;
`GOOGLE_APPLICATION_CREDENTIALS`; `AZURE_STORAGE_ACCOUNT_NAME`, `AZURE_STORAGE_ACCOUNT_KEY`. Every call ends
within CALL_S. A failure raises ArchiveAway or ArchiveRefused with a one-line message without addresses or
secrets.

The log warns before a file store is full, and says once why background work on a store fails, even while no
robot is online.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import re
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from datetime import timedelta
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, TypeVar
from urllib.parse import unquote, urlsplit

from posecast_wire.command_line.installation import advise_extra

from posecast_relay.config.store_url import StoreUrlError, check_store_url
from posecast_relay.runtime.tasks import BlockingCalls

log = logging.getLogger("posecast_relay")

T = TypeVar("T")

CALL_S = 10.0  # the timeout of a call
CONNECT_S = 3.0
FOLDER_CALLS = 4  # at once to a store that is a folder
LISTED = 1000  # names per part of a listing
DEPTH_MAX = 8  # how deep a listing of a file store goes; our folders are five deep
UNFINISHED = re.compile(r"#[0-9]{1,9}$", re.ASCII)  # a file being written, before it gets its final name
NO_SPACE = "no space is left"
NO_ENTRY = "access denied: check its keys"
S3_KEYS = (  # one of these gives access to S3; otherwise the machine's cloud role does
    "AWS_ACCESS_KEY_ID",
    "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI",
    "AWS_CONTAINER_CREDENTIALS_FULL_URI",
    "AWS_WEB_IDENTITY_TOKEN_FILE",
    "AWS_SKIP_SIGNATURE",
)
REASONS = (  # patterns in the library's errors, and what they mean
    (r"os error (?:28|122)\)", NO_SPACE),
    (r"os error 30\)", "it is read-only"),
    (r"os error (?:1|13)\)", "permission denied"),
    (r"os error (?:20|21|17|36)\)", "something else is in the place of an object"),
    (r"NoSuchBucket|NoSuchContainer|ContainerNotFound|bucket does not exist", "there is no such bucket"),
    (
        r"InvalidAccessKeyId|SignatureDoesNotMatch|AccessDenied|AuthenticationFailed|40[13] |"
        r"Unauthenticated|PermissionDenied|[Mm]issing (?:credentials|region)|[Cc]redential",
        NO_ENTRY,
    ),
    (r"os error \d+\)", "the file system reports an error"),
)


class ArchiveError(Exception):
    """A call to the object store failed. The message is one line without addresses."""


class ArchiveAway(ArchiveError):
    """It does not answer right now. Retry soon."""


class ArchiveRefused(ArchiveError):
    """It refuses: wrong keys, no such bucket, no space, no permission. An operator must act."""


class StoredObject(NamedTuple):
    """An object in a listing. `key`: relative to the store's URL, with slashes; `size`: in bytes."""

    key: str
    size: int


class FreeSpace(NamedTuple):
    """The free space of a file system, in bytes."""

    free: int
    total: int


def open_object_store(url: str, call_s: float = CALL_S, *, makes_folder: bool = True) -> ObjectStore:
    """Open the store at a URL. This makes no request yet.

    A missing folder is created for this user alone, or refused with `makes_folder` False. Raises
    StoreUrlError if the URL is invalid, the store can't be opened, or obstore isn't installed.
    """
    url = check_store_url(url)
    try:
        from obstore.exceptions import BaseError  # noqa: PLC0415 — 16 MB that only an archive needs
        from obstore.store import LocalStore, from_url  # noqa: PLC0415
    except ImportError:
        raise StoreUrlError(advise_extra("posecast-relay", "archive")) from None
    folder: Path | None = None
    opened: Any
    try:
        if url.startswith("file:"):
            folder = Path(unquote(urlsplit(url).path))
            is_new = not folder.exists()
            if not is_new and not folder.is_dir():
                raise StoreUrlError("this is a file, not a folder")
            if is_new and not makes_folder:
                raise StoreUrlError("there is no such folder")
            if is_new:
                folder.mkdir(mode=0o700, parents=True)
            opened = LocalStore(folder, automatic_cleanup=True)
            return ObjectStore(opened, call_s, folder, is_new=is_new)
        options: dict[str, Any] = {
            "timeout": timedelta(seconds=call_s),
            "connect_timeout": timedelta(seconds=CONNECT_S),
        }
        if _endpoint().startswith("http://"):  # the operator chose plain HTTP explicitly
            options["allow_http"] = True
        retry: Any = {"max_retries": 1, "retry_timeout": timedelta(seconds=call_s)}
        opened = from_url(url, client_options=options, retry_config=retry)  # type: ignore[call-overload]
        return ObjectStore(opened, call_s, hint=_find_hint(url))
    except StoreUrlError:
        raise
    except (BaseError, ValueError, OSError) as e:
        raise StoreUrlError(_describe(e) or "can't open it") from None


def _find_hint(url: str) -> str:
    """Return what to set if an S3 store gets no keys from the environment; otherwise an empty text."""
    if not url.startswith("s3:") or any(os.environ.get(name) for name in S3_KEYS):
        return ""
    return "; it has no keys: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"


def _endpoint() -> str:
    names = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")
    return next((os.environ[name] for name in names if os.environ.get(name)), "")


class ObjectStore:
    """Objects by key. `put` is atomic. Keys use slashes and are relative to the store's URL."""

    def __init__(
        self,
        store: Any,
        call_s: float = CALL_S,
        folder: Path | None = None,
        *,
        is_new: bool = False,
        hint: str = "",
    ) -> None:
        """`store`: obstore's; `folder`: its path if it is on this machine; `is_new`: it was just created;
        `hint`: the end of the message when access is denied.
        """
        self.is_new = is_new
        self._hint = hint
        import obstore  # noqa: PLC0415 — see above
        from obstore.exceptions import GenericError  # noqa: PLC0415

        self._general_error: type[Exception] = GenericError
        self.folder = folder
        self._device = None if folder is None else _find_device(folder)
        self._folder_calls = BlockingCalls(FOLDER_CALLS, "archive")  # a network file system can hang
        self._obstore: Any = obstore
        self._store = store
        self._call_s = call_s

    async def put(self, key: str, data: bytes) -> None:
        """Write a whole object, replacing any with the same key. Raises ArchiveError."""
        await self._check_folder()
        try:
            await self._call(self._obstore.put_async(self._store, key, data, use_multipart=False))
        except FileNotFoundError:
            raise ArchiveRefused(
                "there is no such bucket" if self.folder is None else "its folder is gone"
            ) from None

    async def get(self, key: str) -> bytes | None:
        """Return an object's bytes; None if there is none with this key. Raises ArchiveError."""

        async def read() -> bytes:
            found = await self._obstore.get_async(self._store, key)
            return bytes(await found.bytes_async())

        with contextlib.suppress(FileNotFoundError):
            return await self._call(read())
        await self._check_folder()
        return None

    async def get_range(self, key: str, start: int, length: int) -> bytes | None:
        """Return a range of an object's bytes, empty if it ends before `start`; None if there is no such
        object.

        Raises ArchiveError.
        """

        async def read() -> bytes:
            try:
                return bytes(
                    await self._obstore.get_range_async(self._store, key, start=start, length=length)
                )
            except self._general_error:  # for example if there are no bytes from `start` on
                head = await self._obstore.head_async(self._store, key)
                if head["size"] <= start:
                    return b""
                raise

        with contextlib.suppress(FileNotFoundError):
            return await self._call(read())
        await self._check_folder()
        return None

    async def delete(self, key: str) -> None:
        """Delete an object, or the remains of a killed `put`; it may already be gone.

        Raises ArchiveError.
        """
        if self.folder is not None and UNFINISHED.search(key):  # obstore does not accept that as a key
            await self._call(self._folder_calls.run(_unlink, self.folder / key))
            return
        with contextlib.suppress(FileNotFoundError):
            await self._call(self._obstore.delete_async(self._store, key))

    async def list_objects(self, prefix: str) -> AsyncIterator[list[StoredObject]]:
        """Yield all objects below a folder, in parts of LISTED, in no order. Raises ArchiveError.

        In a local folder it does not follow links or go deeper than DEPTH_MAX.
        """
        await self._check_folder()
        if self.folder is not None:
            walk = _walk(self.folder / prefix, self.folder)
            while part := await self._call(self._folder_calls.run(_take_part, walk)):
                yield part
            return
        stream = self._obstore.list(self._store, prefix or None, chunk_size=LISTED)
        while True:
            try:
                found = await self._call(anext(stream))
            except (StopAsyncIteration, FileNotFoundError):
                return
            yield [StoredObject(each["path"], each["size"]) for each in found]

    async def list_folders(self, prefix: str) -> list[str]:
        """Return the names of the folders in a folder, sorted. Raises ArchiveError."""
        await self._check_folder()
        if self.folder is not None:
            return await self._call(self._folder_calls.run(_list_folders, self.folder / prefix))
        asked = self._obstore.list_with_delimiter_async(self._store, prefix or None)
        found = await self._call(asked)
        return sorted(path.rstrip("/").rpartition("/")[2] for path in found["common_prefixes"])

    async def measure_free(self) -> FreeSpace | None:
        """Return the free space of the file system; None if it can't be known. Raises ArchiveError."""
        if self.folder is None:
            return None
        await self._check_folder()
        try:
            found = await self._call(self._folder_calls.run(os.statvfs, self.folder))
        except FileNotFoundError:  # it disappeared just now
            raise ArchiveRefused("its folder is gone") from None
        return FreeSpace(found.f_bavail * found.f_frsize, found.f_blocks * found.f_frsize)

    async def _check_folder(self) -> None:
        """Raise ArchiveRefused if the folder or the disk mounted there is gone.

        Otherwise an empty folder would look like an empty past, and new data would fill another disk.
        """
        if self.folder is not None and self._device is not None:
            device = await self._call(self._folder_calls.run(_find_device, self.folder))
            if device != self._device:
                raise ArchiveRefused("its folder is gone" if device is None else "its disk is not mounted")

    async def _call(self, asked: Awaitable[T]) -> T:
        try:
            async with asyncio.timeout(self._call_s):
                return await asked
        except FileNotFoundError as e:
            if "NoSuchBucket" in str(e):
                raise ArchiveRefused("there is no such bucket") from None
            raise
        except StopAsyncIteration:
            raise
        except TimeoutError:
            raise ArchiveAway(f"no answer within {self._call_s:g} s{self._hint}") from None
        except Exception as e:  # obstore has its own base class; no error here may affect live data
            why = _describe(e)
            if why is not None:
                raise ArchiveRefused(why + (self._hint if why == NO_ENTRY else "")) from None
            raise ArchiveAway(f"does not answer ({type(e).__name__}){self._hint}") from None


def _describe(error: Exception) -> str | None:
    """Describe why a store refuses; None if the cause is unknown."""
    text = f"{type(error).__name__} {str(error)[:4000]}"
    if isinstance(error, OSError) and error.errno is not None:
        text += f"(os error {error.errno})"
    return next((why for form, why in REASONS if re.search(form, text)), None)


def _unlink(path: Path) -> None:
    path.unlink(missing_ok=True)


def _find_device(folder: Path) -> int | None:
    """Return the file system of a folder; None if there is no such folder."""
    try:
        return os.stat(folder).st_dev if folder.is_dir() else None
    except FileNotFoundError:
        return None


def _walk(folder: Path, root: Path, depth: int = DEPTH_MAX) -> Iterator[StoredObject]:
    """Yield the files below a folder. obstore's listing ends at a name with a line break, so we walk
    ourselves."""
    try:
        with os.scandir(folder) as found:
            entries = sorted(found, key=lambda entry: entry.name)
    except (FileNotFoundError, NotADirectoryError):
        return
    for entry in entries:
        try:
            if entry.is_dir(follow_symlinks=False):
                if depth > 1:
                    yield from _walk(Path(entry.path), root, depth - 1)
            elif entry.is_file(follow_symlinks=False):
                key = Path(entry.path).relative_to(root).as_posix()
                yield StoredObject(key, entry.stat(follow_symlinks=False).st_size)
        except FileNotFoundError:
            continue  # deleted in the meantime


def _take_part(walk: Iterator[StoredObject]) -> list[StoredObject]:
    return list(islice(walk, LISTED))


def _list_folders(folder: Path) -> list[str]:
    try:
        with os.scandir(folder) as found:
            return sorted(entry.name for entry in found if entry.is_dir(follow_symlinks=False))
    except (FileNotFoundError, NotADirectoryError):
        return []


LEAST_SHARE, LEAST_BYTES = 0.1, 1 << 30  # warn below either of these
SMALL_SHARE = 0.25  # instead of LEAST_BYTES if it is less: most of a small disk is never free
CALM = 1.2  # the warning ends at this multiple of the limit


class SpaceWatch:
    """The free space of a store; only known for a local folder."""

    def __init__(self, store: ObjectStore, least_bytes: int = LEAST_BYTES) -> None:
        self.space: FreeSpace | None = None
        self._store = store
        self._least_bytes = least_bytes
        self._is_low = False
        self._rule = ""  # the limit that was crossed

    async def look(self) -> None:
        """Measure, and log a line when space becomes low or is sufficient again."""
        try:
            self.space = await self._store.measure_free()
        except ArchiveError:
            return  # the writer reports this
        if self.space is None:
            return
        low = self._is_below(CALM if self._is_low else 1.0)
        if low != self._is_low:
            self._is_low, self._rule = low, self._find_rule()
            what = "the disk is nearly full" if low else "the disk has room again"
            log.warning("the archive: %s: %s", what, self._describe())

    def find_trouble(self) -> str | None:
        """Return a warning if little space is left; None if there is enough, or if it is unknown."""
        return f"the disk is nearly full: {self._describe()}" if self._is_low else None

    def _describe(self) -> str:
        assert self.space is not None
        free, total = self.space
        left = f"{free >> 20} MB, {100 * free // max(1, total)} % of it"
        return f"{self._rule} is left, {left}" if self._is_low else left

    def _find_rule(self) -> str:
        assert self.space is not None
        free, total = self.space
        if free >= self._least_bytes:
            return f"less than {100 * LEAST_SHARE:g} %"
        if SMALL_SHARE * total < self._least_bytes:
            return f"less than {100 * SMALL_SHARE:g} %"
        return f"less than {self._least_bytes / (1 << 30):g} GiB"

    def _is_below(self, factor: float) -> bool:
        assert self.space is not None
        free, total = self.space
        few = min(self._least_bytes, SMALL_SHARE * total)
        return free < factor * max(LEAST_SHARE * total, few)


class BackgroundTrouble:
    """Why parts of the background work currently fail. `is_reported`: whether the log already reports the
    store as away.
    """

    def __init__(self, is_reported: Callable[[], bool] = lambda: False) -> None:
        self._is_reported = is_reported
        self._why: dict[str, str] = {}  # by part

    def note_failure(self, part: str, why: str) -> None:
        """Note that a part failed. Logs it if all was well before."""
        if not self._why and not self._is_reported():
            log.warning("the archive: %s; retrying until it works", why)
        self._why[part] = why

    def note_success(self, part: str) -> None:
        """Note that a part succeeded. Logs it if that was the last failing part."""
        if self._why.pop(part, None) is not None and not self._why:
            log.warning("the archive: the store works again")

    def find_trouble(self) -> str | None:
        """Return why a part fails; None if all is well. Callable from any thread."""
        return next(iter(list(self._why.values())), None)
