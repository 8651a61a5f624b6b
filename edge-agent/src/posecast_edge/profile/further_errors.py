"""Finds further errors in a profile: removes the entry that caused the last error, then reads it again."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

from posecast_edge.profile.values import ProfileError

ERRORS_MAX = 20  # of one profile, the first included
READ_BYTES_MAX = 1 << 20  # for all reads together
# Entries that other tables refer to, and the names that are unknown there once the entry is removed.
_DEFINED = (
    (re.compile(r"labels\..*|fields\[\d+\]\.labels"), "label|label set|joint|channel|name|site|place"),
    (re.compile(r"fields\[\d+\]\.bits"), "bit"),
    (re.compile(r"sensors\.[^.]+"), "name|site|place"),
)


def find_further_errors(
    document: dict[str, Any], size: int, first: ProfileError, read: Callable[[dict[str, Any]], object]
) -> Iterator[str]:
    """The lines of the errors after `first`. Removes entries from `document`. `size`: bytes of its text;
    `read` raises the next ProfileError, if any."""
    error, seen, lost = first, {first.path}, set[str]()
    for _ in range(min(ERRORS_MAX, READ_BYTES_MAX // max(size, 1)) - 1):
        removed = _remove(document, error.path)
        if removed is None:
            return
        lost |= {kinds for entry, kinds in _DEFINED if entry.fullmatch(removed)}
        try:
            read(document)
        except ProfileError as next_error:
            error = next_error
        else:
            return
        # a removed entry may be required: the next error reports it as missing, which is not a new error
        is_missed = error.path in seen or error.path == removed.rpartition(".")[0]
        seen.add(error.path)
        if not is_missed and not any(re.search(f": unknown (?:{kinds}) ", str(error)) for kinds in lost):
            yield str(error)


def _remove(document: dict[str, Any], path: str) -> str | None:
    """Delete the entry at `path`, or the nearest table around it, and return its path; None when that is a
    whole field or the document. Keeps list items, because errors name them by position."""
    owner: dict[str, Any] = document
    held: tuple[dict[str, Any], str, str] | None = None
    walked, rest = "", path
    while rest:
        begins = (k for k in owner if rest.startswith(k) and rest[len(k) : len(k) + 1] in ("", ".", "["))
        key = max(begins, key=len, default=None)
        if key is None:
            break
        walked, rest = f"{walked}.{key}" if walked else key, rest[len(key) :].removeprefix(".")
        held, value = (owner, key, walked), owner[key]
        field = re.match(r"\[(\d+)\]\.?", rest) if walked == "fields" else None
        if field and isinstance(value, list) and isinstance(value[int(field[1])], dict):
            held, value = None, value[int(field[1])]
            walked, rest = f"fields[{field[1]}]", rest[field.end() :]
        if not isinstance(value, dict):
            break
        owner = value
    if held is None or held[2] == "fields":
        return None
    del held[0][held[1]]
    return held[2]
