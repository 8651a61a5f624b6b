"""Files for readers that want a path. They go when the process does."""

from __future__ import annotations

import functools
import os
import tempfile
from pathlib import Path

_held: list[tempfile.TemporaryDirectory[str]] = []


def new_folder() -> Path:
    """An empty one."""
    _held.append(tempfile.TemporaryDirectory(prefix="fuzz-"))
    return Path(_held[-1].name)


@functools.cache
def _folder_of(_pid: int) -> Path:
    return new_folder()


def file_of(data: bytes, name: str) -> Path:
    """A file with these bytes, this process's own; readable by nobody else."""
    file = _folder_of(os.getpid()) / name
    file.write_bytes(data)
    file.chmod(0o600)
    return file
