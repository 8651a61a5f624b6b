"""Serves built files from memory, so that a thousand simultaneous requests need neither disk nor threads.

They are the page, whose index is also under paths that name robots, and the guide at `/guide/`, the built
documentation.
"""

from __future__ import annotations

import html
import os
import re
import stat
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import HTTPException, Response
from fastapi.responses import FileResponse, PlainTextResponse, RedirectResponse
from fastapi.staticfiles import StaticFiles
from starlette.datastructures import Headers
from starlette.types import Receive, Scope, Send

from posecast_relay.http.previews import LinkPreview, find_home, place_page, read_robots
from posecast_relay.kit import NEVER, ExpiringCache
from posecast_relay.net.request import OPEN, choose_encoding

POLICY_TAG = re.compile(r'(?i)<meta\s+http-equiv="content-security-policy"\s+content="([^"]*)"')
PAGES_MAX = 256  # whose policies are cached


def read_content_policy(page: Path) -> str | None:
    """Return a page's content security policy; None if it has none.

    Sent as a header, the policy also applies to the page's workers.
    """
    try:
        return _read_policy(page, page.stat().st_mtime_ns)
    except OSError:  # it is being rebuilt right now
        return None


@lru_cache(maxsize=PAGES_MAX)
def _read_policy(page: Path, _mtime_ns: int) -> str | None:
    found = POLICY_TAG.search(page.read_text(encoding="utf-8"))
    return None if found is None else " ".join(html.unescape(found[1]).split())


OF_A_DISK = ("accept-ranges", "content-length")  # headers of an answer that is read from disk in parts
KEPT_BYTES = 64_000_000  # of all files
KEEP_UP_TO_BYTES = 8_000_000  # of one file; a larger one is read from disk for each request
DETOURS = frozenset(("", ".", ".."))  # folder names that a path must not contain
HASHED = "public, max-age=31536000, immutable"  # of files with a hash in their name
# compressed forms that a build makes, by content encoding, and the suffix of their files; the smallest first
PACKED = {"br": ".br", "gzip": ".gz"}
FRESH = {"cache-control": "no-cache", "x-content-type-options": "nosniff"}  # browsers ask each time
PAGE_HEADERS = {
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
}


class KeptFiles:
    """Keeps files in memory until they change on disk."""

    def __init__(self) -> None:
        self._files: ExpiringCache[tuple[int, int, bytes]] = ExpiringCache(KEPT_BYTES)  # by path

    def read(self, path: str, found: os.stat_result) -> bytes:
        """Return a file's bytes. Raises OSError."""
        known = self._files.find(path, 0.0)
        if known is None or known[:2] != (found.st_mtime_ns, found.st_size):
            known = found.st_mtime_ns, found.st_size, Path(path).read_bytes()
            self._files.put(path, known, len(known[2]), NEVER)
        return known[2]


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
        response.headers.update(FRESH)
        return response


# Pages that are cross-origin isolated (COEP) load and frame only what says that it may be, and frame only
# pages that demand the same of what they load, as must a page's workers.
FOR_ISOLATED = {
    "cross-origin-resource-policy": "cross-origin",
    "cross-origin-embedder-policy": "require-corp",
}
FRAMES = "frame-ancestors 'none'"  # browsers accept this only in a header
# the page's entry for frames: /embed/ROBOT, or /embed/, where only the fragment names the robot
EMBED = re.compile(r"/embed/(?:index\.html)?(?P<robot>[a-z0-9][a-z0-9-]{0,62})?")
# content management systems add a slash; the page's files are relative to the address without it
SLASHED = re.compile(r"/embed/(?P<robot>[a-z0-9][a-z0-9-]{0,62})/")
# headers removed from such an answer: the policy can change without the file, so it must not be cached
NOT_FRAMED = ("x-frame-options", "etag", "last-modified")


class Page(StaticFolder):
    """The built page. Browsers ask for its index each time, and for files with a hash in their name once."""

    def __init__(
        self,
        folder: Path,
        kept: KeptFiles,
        frame_ancestors: Callable[[str], Sequence[str]],
        preview: LinkPreview,
    ) -> None:
        """`frame_ancestors` returns the sites that may embed a robot ("": any robot); see Policy."""
        super().__init__(folder, kept)
        self._index = folder / "index.html"
        self._frame_ancestors = frame_ancestors
        self._preview = preview

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return a file.

        The page for embedding is the same for every robot, but with that robot's `frame-ancestors`.
        """
        slashed = SLASHED.fullmatch(scope["path"])
        if slashed is not None:
            query = scope["query_string"].decode("latin-1")
            return RedirectResponse(f"../{slashed['robot']}{query and '?'}{query}")
        framed = EMBED.fullmatch(scope["path"])
        if framed is None:
            return await self._answer_anybody(path, scope)
        kept = [(k, v) for k, v in scope["headers"] if k not in (b"if-none-match", b"if-modified-since")]
        response = self.read_file("embed/index.html", {**scope, "headers": kept})
        if response.status_code == HTTPStatus.OK:
            frames = "frame-ancestors " + " ".join(self._frame_ancestors(framed["robot"] or ""))
            policy = response.headers.get("content-security-policy", FRAMES)
            response.headers["content-security-policy"] = policy.replace(FRAMES, frames)
            response.headers.update(FOR_ISOLATED)
            for name in NOT_FRAMED:
                del response.headers[name]
        return response

    async def _answer_anybody(self, path: str, scope: Scope) -> Response:
        """Return a file, the page for robots that the path names, or the page with 404 for other paths."""
        robots = read_robots(scope["path"])
        try:
            return self.find_file(path, scope)
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
        """Return the page's index adapted to this path, with status 404 if the path names no robots.

        None if the page can't be at this path. Hidden robots and unknown ones get the same answer.
        """
        home = find_home(scope.get("raw_path", scope["path"].encode()).decode("latin-1"))
        try:
            index = self._kept.read(str(self._index), self._index.stat()).decode()
        except (OSError, ValueError):  # it is being rebuilt right now
            return None
        if home is None:
            return None
        headers = PAGE_HEADERS | FRESH | {"vary": "accept"}
        policy = read_content_policy(self._index)
        if policy is not None:
            headers["content-security-policy"] = f"{policy}; {FRAMES}"
        status = HTTPStatus.NOT_FOUND if robots is None else HTTPStatus.OK
        is_read = "sec-fetch-mode" in Headers(scope=scope)  # browsers say so, crawlers don't
        page = await self._preview.make_page(index, home, robots, is_read)
        return Response(page, status, headers, "text/html; charset=utf-8")

    def file_response(
        self, full_path: Any, stat_result: os.stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        """Return a file with the page's headers."""
        response = super().file_response(full_path, stat_result, scope, status_code)
        hashed = "/assets/" in scope["path"]
        if hashed:
            response.headers["cache-control"] = HASHED
            response.headers.update(FOR_ISOLATED)
        # a frame with `sandbox` has no origin, so it may read only what any page may
        if hashed or scope["path"].endswith("/config.json"):
            response.headers.update(OPEN)
        page = Path(full_path) if str(full_path).endswith(".html") else self._index if hashed else None
        policy = None if page is None else read_content_policy(page)
        if policy is not None:
            response.headers["content-security-policy"] = policy if hashed else f"{policy}; {FRAMES}"
        if page is not None and not hashed:
            response.headers.update(PAGE_HEADERS)
        return response


NO_GUIDE = """This relay has no guide, because its page was built without one.
In a checkout, `make site` builds it.
"""
# pages of the guide show recordings in frames
GUIDE_FRAMES = "frame-ancestors 'self'"
GUIDE_HEADERS = PAGE_HEADERS | {"x-frame-options": "SAMEORIGIN"}
# its pages have no inline scripts or styles; its icons are in its style sheets
GUIDE_POLICY = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'none'"
)
HASHED_NAME = re.compile(r"\.[0-9a-f]{8}\.min\.(?:css|js)$|/assets/[^/]+-[\w-]{8}\.(?:css|js)$")
SCRIPTS_AND_PAGES = (".html", ".js")


class Guide(StaticFolder):
    """The guide. A recording inside it is a separate page with its own content security policy."""

    def __init__(self, folder: Path, kept: KeptFiles) -> None:
        """If `folder` is missing, `/guide/` says so."""
        super().__init__(folder, kept)
        self._folder = folder
        self.config_checked = True  # otherwise Starlette refuses a folder that may be built later

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return a file, or a 404 page."""
        try:
            return self.find_file(path, scope)
        except HTTPException as e:
            if e.status_code != HTTPStatus.NOT_FOUND:
                raise
            return self._make_absence(scope)

    def _make_absence(self, scope: Scope) -> Response:
        policy = {"content-security-policy": f"{GUIDE_POLICY}; {GUIDE_FRAMES}"}
        headers = GUIDE_HEADERS | FRESH | policy
        page = self._folder / "404.html"
        home = find_home(scope.get("raw_path", scope["path"].encode()).decode("latin-1"))
        try:
            text = self._kept.read(str(page), page.stat()).decode()
        except (OSError, ValueError):
            return PlainTextResponse(NO_GUIDE, HTTPStatus.NOT_FOUND, headers)
        if home is None:
            raise HTTPException(HTTPStatus.NOT_FOUND)
        placed = place_page(text, f"{home}guide/")
        return Response(placed, HTTPStatus.NOT_FOUND, headers, "text/html; charset=utf-8")

    def file_response(
        self, full_path: Any, stat_result: os.stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        """Return a file with the guide's headers."""
        response = super().file_response(full_path, stat_result, scope, status_code)
        file = Path(full_path)
        if HASHED_NAME.search(file.as_posix()):
            response.headers["cache-control"] = HASHED
        if file.suffix in SCRIPTS_AND_PAGES:  # a script may be a worker, which needs its own policy
            response.headers["content-security-policy"] = f"{self._find_policy(file)}; {GUIDE_FRAMES}"
        if file.suffix == ".html":
            response.headers.update(GUIDE_HEADERS)
        return response

    def _find_policy(self, file: Path) -> str:
        """Return the policy of the recording that the file belongs to, else the guide's."""
        for index in self._list_indexes(file):
            policy = read_content_policy(index)
            if policy is not None:
                return policy
        return GUIDE_POLICY

    def _list_indexes(self, file: Path) -> Iterator[Path]:
        folder, top = file.parent, self._folder.resolve()
        while folder.is_relative_to(top) and folder != top:
            yield folder / "index.html"
            folder = folder.parent
