"""Serves built files from memory, so that a thousand simultaneous requests need neither disk nor threads."""

from __future__ import annotations

import os
import stat
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import HTTPException, Response
from fastapi.responses import FileResponse, RedirectResponse
from fastapi.staticfiles import StaticFiles
from starlette.datastructures import Headers
from starlette.types import Receive, Scope, Send

from posecast_relay.http.accept_encoding import choose_encoding

OF_A_DISK = ("accept-ranges", "content-length")  # headers of an answer that is read from disk in parts
KEPT_BYTES = 64_000_000  # of all files; beyond this, the cache starts over
KEEP_UP_TO_BYTES = 8_000_000  # of one file; a larger one is read from disk for each request
DETOURS = frozenset(("", ".", ".."))  # folder names that a path must not contain
HASHED = "public, max-age=31536000, immutable"  # of files with a hash in their name
# compressed forms that a build makes, by content encoding, and the suffix of their files; the smallest first
PACKED = {"br": ".br", "gzip": ".gz"}
PAGE_HEADERS = {
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
}


class KeptFiles:
    """Keeps files in memory until they change on disk."""

    def __init__(self) -> None:
        self._files: dict[str, tuple[int, int, bytes]] = {}
        self._bytes = 0

    def read(self, path: str, found: os.stat_result) -> bytes:
        """Return a file's bytes. Raises OSError."""
        known = self._files.get(path)
        if known is not None and known[:2] == (found.st_mtime_ns, found.st_size):
            return known[2]
        data = Path(path).read_bytes()
        if known is not None:
            self._bytes -= len(known[2])
        elif self._bytes + len(data) > KEPT_BYTES:
            self._files.clear()
            self._bytes = 0
        self._files[path] = found.st_mtime_ns, found.st_size, data
        self._bytes += len(data)
        return data


class _Shared(Response):
    """An answer whose bytes all clients share, so that a slow client takes no extra memory."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the answer, as ASGI defines, marked as shared."""
        scope["shared"] = True
        await super().__call__(scope, receive, send)


class StaticFolder(StaticFiles):
    """A folder of built files. Browsers ask each time whether a file has changed."""

    def __init__(self, folder: Path, kept: KeptFiles) -> None:
        """`kept`: the memory for the files of all folders."""
        super().__init__(directory=folder, html=True, check_dir=False)
        self._kept = kept

    def find_file(self, path: str, scope: Scope) -> Response:
        """Return the file that a request names, below the folder. Raises HTTPException."""
        *folders, name = scope["path"].split("/")[1:]
        # never leave the folder: clients must not learn what exists elsewhere
        if DETOURS.intersection(folders) or name in DETOURS - {""}:
            raise HTTPException(HTTPStatus.NOT_FOUND)
        return self.read_file(path if name else os.path.join(path, "index.html"), scope)

    def read_file(self, path: str, scope: Scope) -> Response:
        """Return a file, a folder's index, or a redirect to it. Raises HTTPException."""
        if scope["method"] not in ("GET", "HEAD"):
            raise HTTPException(HTTPStatus.METHOD_NOT_ALLOWED, headers={"allow": "GET, HEAD"})
        try:
            full_path, found = self.lookup_path(path)
            if found is not None and stat.S_ISDIR(found.st_mode):
                if not scope["path"].endswith("/"):
                    return RedirectResponse(f"{scope['path']}/")
                full_path, found = self.lookup_path(os.path.join(path, "index.html"))
            if found is not None and stat.S_ISREG(found.st_mode):
                return self.file_response(full_path, found, scope)
        except (OSError, ValueError):  # not a valid file name, or not readable
            pass
        raise HTTPException(HTTPStatus.NOT_FOUND)

    def file_response(
        self, full_path: Any, stat_result: os.stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        """Return a file, compressed if the build made a compressed one that the browser accepts."""
        packed = {
            encoding: path
            for encoding, suffix in PACKED.items()
            if os.path.isfile(path := f"{full_path}{suffix}")
        }
        encoding = choose_encoding(Headers(scope=scope), tuple(packed))
        served, found = full_path, stat_result
        if encoding is not None:
            served = packed[encoding]
            found = os.stat(served)
        response = super().file_response(served, found, scope, status_code)
        if isinstance(response, FileResponse) and found.st_size <= KEEP_UP_TO_BYTES:
            headers = {k: v for k, v in response.headers.items() if k not in OF_A_DISK}
            response = _Shared(self._kept.read(served, found), status_code, headers)
        response.headers["vary"] = "accept-encoding"
        if encoding is not None:
            response.headers["content-encoding"] = encoding
        response.headers["cache-control"] = "no-cache"
        response.headers["x-content-type-options"] = "nosniff"
        return response
