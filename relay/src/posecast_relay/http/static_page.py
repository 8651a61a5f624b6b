"""Serves the built page from memory, so that a thousand requests at once wait for no disk and no thread."""

from __future__ import annotations

import html
import os
import re
import stat
from collections.abc import Callable, Sequence
from functools import lru_cache
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import HTTPException, Response
from fastapi.responses import FileResponse, RedirectResponse
from fastapi.staticfiles import StaticFiles
from starlette.datastructures import Headers
from starlette.types import Receive, Scope, Send

from posecast_relay.http.link_preview import LinkPreview
from posecast_relay.http.page_address import find_home, read_robots

OF_A_DISK = ("accept-ranges", "content-length")  # headers of an answer that is read in parts
KEPT_BYTES = 64_000_000  # of all files; beyond, all are read anew
KEEP_UP_TO_BYTES = 8_000_000  # of one; a larger one is read from the disk for each who asks
DETOURS = frozenset(("", ".", ".."))  # what no folder in a path is called
FRAMES = "frame-ancestors 'none'"  # only a header may say so, not the page
# the page's entry for frames: /embed/ROBOT, or /embed/, where only the fragment names the robot
EMBED = re.compile(r"/embed/(?:index\.html)?(?P<robot>[a-z0-9][a-z0-9-]{0,62})?")
# of such an answer: the policy may change and the file not, so nothing of it may be kept
NOT_FRAMED = ("x-frame-options", "etag", "last-modified")
PAGE_HEADERS = {
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
}
POLICY = re.compile(r'(?i)<meta\s+http-equiv="content-security-policy"\s+content="([^"]*)"')


class _Kept:
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


def read_content_policy(page: Path) -> str | None:
    """Return a page's content security policy; None when it has none.

    As a header it binds its workers too.
    """
    try:
        return _read_policy(page, page.stat().st_mtime_ns)
    except OSError:  # it is just being built anew
        return None


@lru_cache(maxsize=16)
def _read_policy(page: Path, _mtime_ns: int) -> str | None:
    found = POLICY.search(page.read_text(encoding="utf-8"))
    return None if found is None else " ".join(html.unescape(found[1]).split())


class _Shared(Response):
    """An answer whose bytes all askers share, so that one that is not read takes no memory of its own."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the answer, as ASGI defines, marked as shared."""
        scope["shared"] = True
        await super().__call__(scope, receive, send)


class Page(StaticFiles):
    """The built page. Browsers ask for its index each time, and for files with a hash in their name once."""

    def __init__(
        self, folder: Path, frame_ancestors: Callable[[str], Sequence[str]], preview: LinkPreview
    ) -> None:
        """`frame_ancestors` returns the pages that may frame a robot ("": any robot); see Policy."""
        super().__init__(directory=folder, html=True)
        self._index = folder / "index.html"
        self._frame_ancestors = frame_ancestors
        self._preview = preview
        self._kept = _Kept()

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return a file.

        The page for frames is the same for every robot, with a header of the robot's own.
        """
        framed = EMBED.fullmatch(scope["path"])
        if framed is None:
            return await self._answer_anybody(path, scope)
        kept = [(k, v) for k, v in scope["headers"] if k not in (b"if-none-match", b"if-modified-since")]
        response = self._answer("embed/index.html", {**scope, "headers": kept})
        if response.status_code == HTTPStatus.OK:
            frames = "frame-ancestors " + " ".join(self._frame_ancestors(framed["robot"] or ""))
            policy = response.headers.get("content-security-policy", FRAMES)
            response.headers["content-security-policy"] = policy.replace(FRAMES, frames)
            for name in NOT_FRAMED:
                del response.headers[name]
        return response

    async def _answer_anybody(self, path: str, scope: Scope) -> Response:
        """A file; the page itself for robots that the path names, and with 404 for a person who mistyped."""
        robots = read_robots(scope["path"])
        *folders, name = scope["path"].split("/")[1:]
        try:
            # no way up and no detour: what is in other folders, or is not, is nobody's business
            if DETOURS.intersection(folders) or name in DETOURS - {""}:
                raise HTTPException(HTTPStatus.NOT_FOUND)
            return self._answer(path if name else os.path.join(path, "index.html"), scope)
        except HTTPException as e:
            reads = "text/html" in Headers(scope=scope).get("accept", "")
            if e.status_code != HTTPStatus.NOT_FOUND:
                raise
            if robots is None and not reads:
                raise HTTPException(e.status_code, e.detail, {"vary": "accept"}) from None
            page = await self._place_index(scope, robots)
            if page is None:
                raise
            return page

    async def _place_index(self, scope: Scope, robots: tuple[str, ...] | None) -> Response | None:
        """Return the page's index as it has to be at this path, with 404 where that names no robots.

        None where the page can't be. A robot that is hidden gets what one gets that does not exist.
        """
        home = find_home(scope.get("raw_path", scope["path"].encode()).decode("latin-1"))
        try:
            index = self._kept.read(str(self._index), self._index.stat()).decode()
        except (OSError, ValueError):  # it is just being built anew
            return None
        if home is None:
            return None
        headers = PAGE_HEADERS | {
            "cache-control": "no-cache",
            "vary": "accept",
            "x-content-type-options": "nosniff",
        }
        policy = read_content_policy(self._index)
        if policy is not None:
            headers["content-security-policy"] = f"{policy}; {FRAMES}"
        status = HTTPStatus.NOT_FOUND if robots is None else HTTPStatus.OK
        is_read = "sec-fetch-mode" in Headers(scope=scope)  # browsers say so, crawlers don't
        page = await self._preview.make_page(index, home, robots, is_read)
        return Response(page, status, headers, "text/html; charset=utf-8")

    def _answer(self, path: str, scope: Scope) -> Response:
        """A file, a folder's index, or where that is. HTTPException."""
        if scope["method"] not in ("GET", "HEAD"):
            raise HTTPException(HTTPStatus.METHOD_NOT_ALLOWED, headers={"allow": "GET, HEAD"})
        try:
            full_path, found = self.lookup_path(path)
            if found is not None and stat.S_ISDIR(found.st_mode):
                if not scope["path"].endswith("/"):
                    return RedirectResponse(f"/{path}/")
                full_path, found = self.lookup_path(os.path.join(path, "index.html"))
            if found is not None and stat.S_ISREG(found.st_mode):
                return self.file_response(full_path, found, scope)
        except (OSError, ValueError):  # no name of a file, or not to be read
            pass
        raise HTTPException(HTTPStatus.NOT_FOUND)

    def file_response(
        self, full_path: Any, stat_result: os.stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        """Return a file with cache headers; compressed where the build did so and the browser accepts it."""
        packed = f"{full_path}.gz"
        unpacks = "gzip" in Headers(scope=scope).get("accept-encoding", "") and os.path.isfile(packed)
        served, found = (packed, os.stat(packed)) if unpacks else (full_path, stat_result)
        response = super().file_response(served, found, scope, status_code)
        if isinstance(response, FileResponse) and found.st_size <= KEEP_UP_TO_BYTES:
            headers = {k: v for k, v in response.headers.items() if k not in OF_A_DISK}
            response = _Shared(self._kept.read(served, found), status_code, headers)
        response.headers["vary"] = "accept-encoding"
        if unpacks:
            response.headers["content-encoding"] = "gzip"
        hashed = "/assets/" in scope["path"]
        response.headers["cache-control"] = "public, max-age=31536000, immutable" if hashed else "no-cache"
        response.headers["x-content-type-options"] = "nosniff"
        page = Path(full_path) if str(full_path).endswith(".html") else self._index if hashed else None
        policy = None if page is None else read_content_policy(page)
        if policy is not None:
            response.headers["content-security-policy"] = policy if hashed else f"{policy}; {FRAMES}"
        if page is not None and not hashed:
            response.headers.update(PAGE_HEADERS)
        return response
