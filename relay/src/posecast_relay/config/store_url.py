"""Checks URLs of object stores without opening them."""

from __future__ import annotations

import re

URL = re.compile(r"(?:file:///|(?:s3|gs|az)://[A-Za-z0-9][A-Za-z0-9._-]{0,62}(?:/|$))[^\s?#]*", re.ASCII)
URL_FORM = "use file:///FOLDER, s3://BUCKET/PREFIX, gs://BUCKET/PREFIX or az://CONTAINER/PREFIX"


class StoreUrlError(ValueError):
    """The URL is not an object store's, or a package is missing. The message is one line."""


def is_store_url(text: str) -> bool:
    """Whether this may be the URL of an object store."""
    try:
        check_store_url(text)
    except StoreUrlError:
        return False
    return True


def check_store_url(url: str) -> str:
    """Return the URL if it may be that of an object store. Raises StoreUrlError."""
    if not URL.fullmatch(url) or "/../" in f"{url}/" or (url.startswith("file:") and len(url) < 9):
        raise StoreUrlError(_find_remedy(url) or URL_FORM)
    return url.rstrip("/")


def _find_remedy(url: str) -> str | None:
    """Return how to correct a path or a folder's URL; None if there is no advice."""
    if re.fullmatch(r"/[^\s/][^\s?#]*", url):
        return f"write file://{url}"
    if not url.startswith(("file:", "/")):
        return None
    if re.search(r"[^\S\r\n]", url) and "\n" not in url:
        return "write %20 for each space"
    if url.startswith(("file://localhost/", "file://127.0.0.1/")):
        return "use file:///FOLDER without a host, with three slashes"
    if re.match(r"file:(?://)?[^/]", url):
        return "use three slashes and an absolute path: file:///FOLDER"
    return None
