"""Serves the guide, the built documentation, at `/guide/`."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import HTTPException, Response
from fastapi.responses import PlainTextResponse
from starlette.types import Scope

from posecast_relay.http.page_address import find_home, place_page
from posecast_relay.http.pages.content_policy import read_content_policy
from posecast_relay.http.pages.static_folder import HASHED, PAGE_HEADERS, KeptFiles, StaticFolder

NO_GUIDE = """This relay has no guide, because its page was built without one.
In a checkout, `make site` builds it.
"""
# pages of the guide show recordings in frames
FRAMES = "frame-ancestors 'self'"
GUIDE_HEADERS = PAGE_HEADERS | {"x-frame-options": "SAMEORIGIN"}
# its pages have no inline scripts or styles; its icons are in its style sheets
POLICY = "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'none'"
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
        headers = GUIDE_HEADERS | {
            "cache-control": "no-cache",
            "content-security-policy": f"{POLICY}; {FRAMES}",
            "x-content-type-options": "nosniff",
        }
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
            response.headers["content-security-policy"] = f"{self._find_policy(file)}; {FRAMES}"
        if file.suffix == ".html":
            response.headers.update(GUIDE_HEADERS)
        return response

    def _find_policy(self, file: Path) -> str:
        """Return the policy of the recording that the file belongs to, else the guide's."""
        for index in self._list_indexes(file):
            policy = read_content_policy(index)
            if policy is not None:
                return policy
        return POLICY

    def _list_indexes(self, file: Path) -> Iterator[Path]:
        folder, top = file.parent, self._folder.resolve()
        while folder.is_relative_to(top) and folder != top:
            yield folder / "index.html"
            folder = folder.parent
