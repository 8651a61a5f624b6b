"""Reads a model's manifest, the list of its files. It comes from a robot, so everything is checked."""

from __future__ import annotations

import re
from typing import NamedTuple

from posecast_wire.checked import loads

BYTES_MAX = 1 << 20
FILES_MAX = 4096
FILE_BYTES_MAX = 1 << 30  # of one file in a manifest; --model-cache-mb limits what a relay caches
MODEL_BYTES_MAX = 1 << 32  # of all files of a model
PATH_MAX = 200  # characters
# a path that can't leave the model's folder and needs no escaping in a URL
PATH = re.compile(r"(?!\.{1,2}(/|$))[\w@+=,~.-][\w @+=,~.-]*(/(?!\.{1,2}(/|$))[\w@+=,~.-][\w @+=,~.-]*)*")
SHA256 = re.compile("[0-9a-f]{64}")
TYPE = re.compile(r"[a-z]{1,40}/[a-z0-9.+-]{1,60}|")


class ManifestError(ValueError):
    """A manifest is invalid. The message is one line that quotes nothing from it."""


class Entry(NamedTuple):
    """A file of a model: its SHA-256 in hex, its size in bytes, and its media type or ''."""

    sha256: str
    size: int
    type: str


def read_manifest(data: bytes) -> dict[str, Entry]:
    """Read the files by path, in time proportional to the size. Raises ManifestError."""
    if len(data) > BYTES_MAX:
        raise ManifestError(f"over {BYTES_MAX} bytes")
    try:
        document = loads(data.decode())
    except ValueError:
        raise ManifestError("not JSON") from None
    listed = document.get("files") if isinstance(document, dict) else None
    if not isinstance(listed, list) or len(listed) > FILES_MAX:
        raise ManifestError(f"files: want a list of at most {FILES_MAX}")
    found: dict[str, Entry] = {}
    sizes: dict[str, int] = {}
    for number, each in enumerate(listed):
        path, entry = _entry(each, f"files[{number}]")
        if path in found:
            raise ManifestError(f"files[{number}]: its path is listed twice")
        if sizes.setdefault(entry.sha256, entry.size) != entry.size:
            raise ManifestError(f"files[{number}]: the same SHA-256 has another size elsewhere")
        found[path] = entry
    if sum(entry.size for entry in found.values()) > MODEL_BYTES_MAX:
        raise ManifestError(f"files: over {MODEL_BYTES_MAX} bytes in all")
    return found


def read_thumbnail(manifest: bytes | bytearray) -> str:
    """Return the path of the model's small picture, unchecked; "" if the manifest names none.

    Raises ValueError if it is not JSON.
    """
    doc = loads(bytes(manifest))
    name = doc.get("thumbnail") if isinstance(doc, dict) else None
    return name if isinstance(name, str) else ""


def _entry(doc: object, where: str) -> tuple[str, Entry]:
    if not isinstance(doc, dict):
        raise ManifestError(f"{where}: want an object")
    path, size, sha256, kind = doc.get("path"), doc.get("size"), doc.get("sha256"), doc.get("type", "")
    if not isinstance(path, str) or len(path) > PATH_MAX or PATH.fullmatch(path) is None:
        raise ManifestError(f"{where}: path: want a relative path of at most {PATH_MAX} plain characters")
    if type(size) is not int or not 0 <= size <= FILE_BYTES_MAX:
        raise ManifestError(f"{where}: size: want a whole number from 0 to {FILE_BYTES_MAX}")
    if not isinstance(sha256, str) or SHA256.fullmatch(sha256) is None:
        raise ManifestError(f"{where}: sha256: want 64 hex digits")
    if not isinstance(kind, str) or TYPE.fullmatch(kind) is None:
        kind = ""
    return path, Entry(sha256, size, kind)
