"""Serves the built page: its files, and its index under paths that name robots."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import HTTPException, Response
from starlette.datastructures import Headers
from starlette.types import Scope

from posecast_relay.http.auth import OPEN
from posecast_relay.http.link_preview import LinkPreview
from posecast_relay.http.page_address import find_home, read_robots
from posecast_relay.http.pages.content_policy import read_content_policy
from posecast_relay.http.pages.static_folder import HASHED, PAGE_HEADERS, KeptFiles, StaticFolder

FRAMES = "frame-ancestors 'none'"  # browsers accept this only in a header
# the page's entry for frames: /embed/ROBOT, or /embed/, where only the fragment names the robot
EMBED = re.compile(r"/embed/(?:index\.html)?(?P<robot>[a-z0-9][a-z0-9-]{0,62})?")
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
        framed = EMBED.fullmatch(scope["path"])
        if framed is None:
            return await self._answer_anybody(path, scope)
        kept = [(k, v) for k, v in scope["headers"] if k not in (b"if-none-match", b"if-modified-since")]
        response = self.read_file("embed/index.html", {**scope, "headers": kept})
        if response.status_code == HTTPStatus.OK:
            frames = "frame-ancestors " + " ".join(self._frame_ancestors(framed["robot"] or ""))
            policy = response.headers.get("content-security-policy", FRAMES)
            response.headers["content-security-policy"] = policy.replace(FRAMES, frames)
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

    def file_response(
        self, full_path: Any, stat_result: os.stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        """Return a file with the page's headers."""
        response = super().file_response(full_path, stat_result, scope, status_code)
        hashed = "/assets/" in scope["path"]
        if hashed:
            response.headers["cache-control"] = HASHED
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
