"""Where an export comes to lie: made beside its place under another name, put there whole or not at all."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import zipfile
from collections.abc import Iterator
from pathlib import Path

from posecast_wire.checked import loads
from posecast_wire.recording import RECORDING_FILE
from posecast_wire.recording.contents import FORMAT, RECORDING_BYTES_MAX

MADE, OLD = "made", "old"
HEAD_BYTES = 16
HEADS = {".csv": "\ufefftime,".encode(), ".mcap": b"\x89MCAP0\r\n"}


class OutputError(Exception):
    """An export can't come to lie where it should. The message is one line that names the place."""


def check_place(target: Path, replace: bool) -> None:
    """Look whether an export may come to lie at `target`. `replace`: where an earlier one lies.

    Raises OutputError.
    """
    _check_parent(target)
    if not os.path.lexists(target):
        return
    if not replace:
        raise OutputError(f"{target}: is there already; --replace puts a new one there")
    if not _is_export(target):
        raise OutputError(f"{target}: is no earlier export, and stays as it is")


@contextlib.contextmanager
def open_place(target: Path, replace: bool) -> Iterator[Path]:
    """Yield a path beside `target` at which to make a folder or a file; when the block ends without an
    exception it is moved to `target`, where an earlier export gives way if `replace`.

    Otherwise nothing is left. What a process that was killed has left there is removed by the next one.
    Raises OutputError, also for an OSError in the block.
    """
    _check_parent(target)
    beside = target.parent / f".{target.name}.part"
    try:
        with _locked(beside, target):
            try:
                _restore(beside / OLD, target)
                check_place(target, replace)
                yield beside / MADE
                _move(beside, target)
            finally:
                shutil.rmtree(beside, ignore_errors=True)
    except OSError as e:
        why = (e.strerror or str(e)).lower()
        raise OutputError(f"{target}: {why}; nothing of it is left") from None


def _check_parent(target: Path) -> None:
    if not target.parent.is_dir():
        raise OutputError(f"{target}: there is no folder {target.parent}")


@contextlib.contextmanager
def _locked(beside: Path, target: Path) -> Iterator[None]:
    """Hold the folder for ourselves, empty but for what a killed process was about to replace."""
    beside.mkdir(exist_ok=True)
    folder = os.open(beside, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OutputError(f"{target}: another process is just writing it") from None
        for left in beside.iterdir():
            if left.name != OLD:
                _remove(left)
        yield
    finally:
        os.close(folder)


def _restore(old: Path, target: Path) -> None:
    """Put back what a process was about to replace when it was killed."""
    if os.path.lexists(old) and not os.path.lexists(target):
        old.rename(target)
    _remove(old)


def _move(beside: Path, target: Path) -> None:
    if not (beside / MADE).is_dir():
        (beside / MADE).replace(target)
        return
    replaces = target.exists()
    if replaces:
        target.rename(beside / OLD)
    try:
        (beside / MADE).rename(target)
    except OSError:
        if replaces:
            (beside / OLD).rename(target)
        raise


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _is_export(path: Path) -> bool:
    """Whether something is what this command writes: it begins so, or says so."""
    try:
        if path.suffix in HEADS and path.is_file():
            with path.open("rb") as file:
                return file.read(HEAD_BYTES).startswith(HEADS[path.suffix])
        doc = loads(_read_index(path))
    except (OSError, KeyError, ValueError, zipfile.BadZipFile, NotImplementedError, RuntimeError):
        return False
    return not path.is_symlink() and isinstance(doc, dict) and doc.get("format") == FORMAT


def _read_index(path: Path) -> bytes:
    """`recording.json` of a folder or a ZIP; nothing of one that is too large."""
    if path.is_dir():
        with (path / RECORDING_FILE).open("rb") as file:
            return file.read(RECORDING_BYTES_MAX)
    with zipfile.ZipFile(path) as packed, packed.open(RECORDING_FILE) as entry:
        return entry.read(RECORDING_BYTES_MAX)
