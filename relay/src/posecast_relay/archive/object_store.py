"""A small port to object stores: a folder (`file:///…`), S3 (`s3://…`), Google's (`gs://…`), Azure's (`az://…`).

Where it lies is told by a URL; how to get in, by the environment, as obstore (Rust's object_store) reads it:
`AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY`, `AWS_REGION`, and `AWS_ENDPOINT_URL` for S3 of others;
`GOOGLE_APPLICATION_CREDENTIALS`; `AZURE_STORAGE_ACCOUNT_NAME`, `AZURE_STORAGE_ACCOUNT_KEY`. Every call ends
within CALL_S. What fails raises ArchiveAway or ArchiveRefused, with a line that holds neither address nor
secret.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, TypeVar
from urllib.parse import unquote, urlsplit

from posecast_wire.command_line.installation import advise_extra

from posecast_relay.store_url import StoreUrlError, check_store_url

T = TypeVar("T")

CALL_S = 10.0  # a call is given up after so long
CONNECT_S = 3.0
THREADS = 4  # that look at a folder
LISTED = 1000  # names in one part of a listing
DEPTH_MAX = 8  # folders that a listing of a file store goes down; ours are five deep
UNFINISHED = re.compile(r"#[0-9]{1,9}$", re.ASCII)  # a file that is written, until it has its name
NO_SPACE = "no space is left"
NO_ENTRY = "our keys are not accepted"
S3_KEYS = (  # by one of these an S3 store lets us in; else by what its cloud gives this machine
    "AWS_ACCESS_KEY_ID",
    "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI",
    "AWS_CONTAINER_CREDENTIALS_FULL_URI",
    "AWS_WEB_IDENTITY_TOKEN_FILE",
    "AWS_SKIP_SIGNATURE",
)
REASONS = (  # what its library says, and what that means: refused for good, or not just now
    (r"os error (?:28|122)\)", NO_SPACE),
    (r"os error 30\)", "it can only be read"),
    (r"os error (?:1|13)\)", "permission denied"),
    (r"os error (?:20|21|17|36)\)", "something else lies where an object is to be"),
    (r"NoSuchBucket|NoSuchContainer|ContainerNotFound|bucket does not exist", "there is no such bucket"),
    (
        r"InvalidAccessKeyId|SignatureDoesNotMatch|AccessDenied|AuthenticationFailed|40[13] |"
        r"Unauthenticated|PermissionDenied|[Mm]issing (?:credentials|region)|[Cc]redential",
        NO_ENTRY,
    ),
    (r"os error \d+\)", "the file system reports an error"),
)


class ArchiveError(Exception):
    """The object store did not do what it was asked to. The message is one line, without addresses."""


class ArchiveAway(ArchiveError):
    """It does not answer just now: the same may be tried again soon."""


class ArchiveRefused(ArchiveError):
    """It says no: wrong keys, no such bucket, no space, no permission. Somebody has to do something."""


class StoredObject(NamedTuple):
    """An object of a listing. `key`: below the store's URL, with slashes; `size`: in bytes."""

    key: str
    size: int


class FreeSpace(NamedTuple):
    """What a file system has left, in bytes."""

    free: int
    total: int


def open_object_store(url: str, call_s: float = CALL_S, *, makes_folder: bool = True) -> ObjectStore:
    """Open the store at a URL; a folder that isn't there is made for this user alone, or with `makes_folder`
    False refused. Nothing else is asked of it yet.

    Raises StoreUrlError when that is none, when it can't be opened, or obstore isn't installed.
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
                raise StoreUrlError("a file lies there, no folder")
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
        if _endpoint().startswith("http://"):  # whoever names it so has decided on that
            options["allow_http"] = True
        retry: Any = {"max_retries": 1, "retry_timeout": timedelta(seconds=call_s)}
        opened = from_url(url, client_options=options, retry_config=retry)  # type: ignore[call-overload]
        return ObjectStore(opened, call_s, hint=_find_hint(url))
    except StoreUrlError:
        raise
    except (BaseError, ValueError, OSError) as e:
        raise StoreUrlError(_describe(e) or "it can't be opened") from None


def _find_hint(url: str) -> str:
    """Say what to set where an S3 store gets no keys from the environment; nothing where it gets some."""
    if not url.startswith("s3:") or any(os.environ.get(name) for name in S3_KEYS):
        return ""
    return "; there are no keys for it here: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"


def _endpoint() -> str:
    names = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")
    return next((os.environ[name] for name in names if os.environ.get(name)), "")


class ObjectStore:
    """Objects by key. A `put` is whole or not at all; keys have slashes, and begin below the store's URL."""

    def __init__(
        self,
        store: Any,
        call_s: float = CALL_S,
        folder: Path | None = None,
        *,
        is_new: bool = False,
        hint: str = "",
    ) -> None:
        """`store`: obstore's; `folder`: where it lies, when that is on this machine; `is_new`: it was made
        just now; `hint`: what ends the message when it lets nobody in.
        """
        self.is_new = is_new
        self._hint = hint
        import obstore  # noqa: PLC0415 — see above
        from obstore.exceptions import GenericError  # noqa: PLC0415

        self._general_error: type[Exception] = GenericError
        self.folder = folder
        self._device = None if folder is None else _find_device(folder)
        self._threads = None if folder is None else ThreadPoolExecutor(THREADS, "archive")
        self._obstore: Any = obstore
        self._store = store
        self._call_s = call_s

    async def put(self, key: str, data: bytes) -> None:
        """Write an object, all at once, over the one of that key if there is one. Raises ArchiveError."""
        await self._check_folder()
        try:
            await self._call(self._obstore.put_async(self._store, key, data, use_multipart=False))
        except FileNotFoundError:
            raise ArchiveRefused(
                "there is no such bucket" if self.folder is None else "its folder is gone"
            ) from None

    async def get(self, key: str) -> bytes | None:
        """Return an object's bytes; None when there is none of that key. Raises ArchiveError."""

        async def read() -> bytes:
            found = await self._obstore.get_async(self._store, key)
            return bytes(await found.bytes_async())

        with contextlib.suppress(FileNotFoundError):
            return await self._call(read())
        await self._check_folder()
        return None

    async def get_range(self, key: str, start: int, length: int) -> bytes | None:
        """Return some of an object's bytes, none where it ends before `start`; None when there is none of
        that key. Raises ArchiveError."""

        async def read() -> bytes:
            try:
                return bytes(
                    await self._obstore.get_range_async(self._store, key, start=start, length=length)
                )
            except self._general_error:  # for one, where there are no bytes from `start` on
                head = await self._obstore.head_async(self._store, key)
                if head["size"] <= start:
                    return b""
                raise

        with contextlib.suppress(FileNotFoundError):
            return await self._call(read())
        await self._check_folder()
        return None

    async def delete(self, key: str) -> None:
        """Delete an object, or what is left of a `put` that was killed; it may be gone already.

        Raises ArchiveError.
        """
        if self.folder is not None and UNFINISHED.search(key):  # obstore takes that for no key
            await self._call(self._start(_unlink, self.folder / key))
            return
        with contextlib.suppress(FileNotFoundError):
            await self._call(self._obstore.delete_async(self._store, key))

    async def list_objects(self, prefix: str) -> AsyncIterator[list[StoredObject]]:
        """Yield all objects below a folder, in parts of LISTED, in no order. Raises ArchiveError.

        Of a folder on this machine: what hides behind links, or deeper than DEPTH_MAX, is not there.
        """
        await self._check_folder()
        if self.folder is not None:
            walk = _walk(self.folder / prefix, self.folder)
            while part := await self._call(self._start(_take_part, walk)):
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
            return await self._call(self._start(_list_folders, self.folder / prefix))
        asked = self._obstore.list_with_delimiter_async(self._store, prefix or None)
        found = await self._call(asked)
        return sorted(path.rstrip("/").rpartition("/")[2] for path in found["common_prefixes"])

    async def measure_free(self) -> FreeSpace | None:
        """Return what the file system has left; None where that can't be known. Raises ArchiveError."""
        if self.folder is None:
            return None
        await self._check_folder()
        try:
            found = await self._call(self._start(os.statvfs, self.folder))
        except FileNotFoundError:  # a moment later
            raise ArchiveRefused("its folder is gone") from None
        return FreeSpace(found.f_bavail * found.f_frsize, found.f_blocks * found.f_frsize)

    async def _check_folder(self) -> None:
        """Raise ArchiveRefused when the folder is gone, or a disk that was mounted there: else an empty one
        would pass for a past in which there was nothing, and what is written would fill another disk.
        """
        if self.folder is not None and self._device is not None:
            device = await self._call(self._start(_find_device, self.folder))
            if device != self._device:
                raise ArchiveRefused("its folder is gone" if device is None else "its disk is not mounted")

    def _start(self, call: Callable[..., T], *args: Any) -> Awaitable[T]:
        """Call the file system beside the event loop, in threads of our own: it may hang, as one of a network
        does, and others need the common ones.
        """
        return asyncio.get_running_loop().run_in_executor(self._threads, partial(call, *args))

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
        except Exception as e:  # obstore's have a base of their own; whatever it is, live must not notice
            why = _describe(e)
            if why is not None:
                raise ArchiveRefused(why + (self._hint if why == NO_ENTRY else "")) from None
            raise ArchiveAway(f"does not answer ({type(e).__name__}){self._hint}") from None


def _describe(error: Exception) -> str | None:
    """Say in our own words why a store refuses; None when nobody is known to be at fault."""
    text = f"{type(error).__name__} {str(error)[:4000]}"
    if isinstance(error, OSError) and error.errno is not None:
        text += f"(os error {error.errno})"
    return next((why for form, why in REASONS if re.search(form, text)), None)


def _unlink(path: Path) -> None:
    path.unlink(missing_ok=True)


def _find_device(folder: Path) -> int | None:
    """Find the file system of a folder; None when there is no such folder."""
    try:
        return os.stat(folder).st_dev if folder.is_dir() else None
    except FileNotFoundError:
        return None


def _walk(folder: Path, root: Path, depth: int = DEPTH_MAX) -> Iterator[StoredObject]:
    """Yield the files below a folder. Not by obstore: one name with a line break in it ends its listing."""
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
            continue  # deleted meanwhile


def _take_part(walk: Iterator[StoredObject]) -> list[StoredObject]:
    return list(islice(walk, LISTED))


def _list_folders(folder: Path) -> list[str]:
    try:
        with os.scandir(folder) as found:
            return sorted(entry.name for entry in found if entry.is_dir(follow_symlinks=False))
    except (FileNotFoundError, NotADirectoryError):
        return []
