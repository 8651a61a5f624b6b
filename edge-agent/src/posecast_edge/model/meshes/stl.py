"""Reads STL, binary and text. A binary file may begin with "solid", so only the length tells them apart."""

from __future__ import annotations

import re

import numpy as np

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.mesh import TEXT_MAX, TRIANGLES_MAX, Mesh, Surface

HEADER = 84
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def read_stl(data: bytes) -> Mesh:
    """Read a file. Raises ModelRefused when header and length disagree or the text is not STL."""
    count = int.from_bytes(data[80:84], "little") if len(data) >= HEADER else 0
    room = (len(data) - HEADER) // RECORD.itemsize
    notes: list[tuple[str, str]] = []
    if len(data) >= HEADER and count == room and len(data) == HEADER + count * RECORD.itemsize:
        return _binary(data, count, notes)
    if data[:2048].lstrip()[:5].lower() == b"solid" and b"facet" in data[:4096].lower():
        return _text(data)
    if count == 0 or count > room:
        held = f"has room for {max(room, 0):,}"
        raise ModelRefused(f"the STL's header claims {count:,} triangles, the file {held}")
    notes.append(
        ("stl-tail", f"{len(data) - HEADER - count * RECORD.itemsize} bytes after the last triangle")
    )
    return _binary(data, count, notes)


def _binary(data: bytes, count: int, notes: list[tuple[str, str]]) -> Mesh:
    if count > TRIANGLES_MAX:
        raise ModelRefused(f"more than {TRIANGLES_MAX:,} triangles")
    corners = np.frombuffer(data, RECORD, count, HEADER)["corners"].reshape(-1, 3)
    return Mesh((Surface(corners, _corners(len(corners))),), tuple(notes))


def _text(data: bytes) -> Mesh:
    if len(data) > TEXT_MAX:
        raise ModelRefused(f"a text STL over {TEXT_MAX >> 20} MiB")
    try:
        words = (float(word) for match in VERTEX.finditer(data) for word in match.groups())
        with np.errstate(over="ignore"):  # overflows to infinity, which is refused later
            numbers = np.fromiter(words, np.float64).astype("<f4")
    except ValueError:
        raise ModelRefused("a vertex of the text STL is not a number") from None
    if len(numbers) % 9:
        raise ModelRefused("the text STL ends within a triangle")
    return Mesh((Surface(numbers.reshape(-1, 3), _corners(len(numbers) // 3)),))


def _corners(count: int) -> np.ndarray[tuple[int, int], np.dtype[np.int32]]:
    return np.arange(count, dtype=np.int32).reshape(-1, 3)
