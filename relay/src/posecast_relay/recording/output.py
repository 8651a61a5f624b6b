"""Where an export is written: beside its place under another name, then moved there whole, or not at all.

Also packs a recording's folder into one `.posecast` file. The same recording always gives the same bytes.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

from posecast_wire.checked import make_visible
from posecast_wire.recording import RECORDING_FILE, PastRecording, decode_recording, segment_path
from posecast_wire.recording.contents import RECORDING_BYTES_MAX

MADE, OLD, COLLECTED = "made", "old", "collected"  # the entries that a hidden folder of ours can have
FOLDERS = frozenset(("segments", "keys", "models"))
PAGE_FOLDERS = frozenset(("assets", "embed"))
PAGE_FILES = frozenset(
    (
        "apple-touch-icon.png",
        "favicon.svg",
        "icon-192.png",
        "icon-512.png",
        "index.html",
        "licenses.json",
        "manifest.webmanifest",
    )
)
DATA_FILES = ("data.csv", "data.mcap")  # beside the page: the recording for other programs
CSV_HEAD = "\ufefftime,seconds,robot_time".encode()
MCAP_MAGIC = b"\x89MCAP0\r\n"
MCAP_NAMES = b"\x04\0\0\0ros2\x08\0\0\0posecast"  # profile and library, after a record's opcode and length
HEAD_BYTES = 64
NAME_SHOWN = 80  # characters of a name in a line
NO_EXPORT = "is not an earlier export, and is left as it is"


class OutputError(Exception):
    """An export can't be written to its place. The message is one line that names the place."""


def check_place(target: Path, replace: bool) -> None:
    """Check that an export may be written to `target`. `replace`: also over an earlier one.

    Raises OutputError.
    """
    _check_parent(target)
    if not os.path.lexists(target) or _is_empty_folder(target):
        return
    if not replace:
        raise OutputError(f"{target}: already exists; give --replace to replace it")
    why = _find_foreign(target)
    if why is not None:
        raise OutputError(f"{target}: {why}")


@contextlib.contextmanager
def open_place(target: Path, replace: bool) -> Iterator[Path]:
    """Yield a path beside `target` at which to make a folder or a file. When the block ends without an
    exception it is moved to `target`, in place of an earlier export if `replace`; otherwise it is removed.

    What a killed process has left there is removed by the next one.
    Raises OutputError, also for an OSError in the block.
    """
    _check_parent(target)
    beside = target.parent / f".{target.name}.posecast-part"
    try:
        with _locked(beside, target):
            try:
                _restore(beside / OLD, target)
                check_place(target, replace)
                yield beside / MADE
                check_place(target, replace)  # somebody may have put something there meanwhile
                _move(beside, target)
            finally:
                _clear(beside, target)
    except OSError as e:
        why = (e.strerror or str(e)).lower()
        left = "" if isinstance(e, IsADirectoryError) else "; nothing of it is left"  # that folder is left
        raise OutputError(f"{target}: {why}{left}") from None


def _is_empty_folder(path: Path) -> bool:
    try:
        return path.is_dir() and not path.is_symlink() and next(path.iterdir(), None) is None
    except OSError:
        return False


def _check_parent(target: Path) -> None:
    if not target.parent.is_dir():
        raise OutputError(f"{target}: there is no folder {target.parent}")


@contextlib.contextmanager
def _locked(beside: Path, target: Path) -> Iterator[None]:
    """Hold the folder for ourselves, empty but for what a killed process was about to replace."""
    if beside.is_symlink() or (os.path.lexists(beside) and not beside.is_dir()):
        raise OutputError(f"{target}: {_name(beside)} beside it is not the folder of an export: move it away")
    beside.mkdir(exist_ok=True)
    folder = os.open(beside, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OutputError(f"{target}: another process is writing it") from None
        found = sorted(beside.iterdir())
        for left in found:
            if left.name not in (MADE, OLD, COLLECTED):
                why = f"holds {_name(left)}, which no export wrote: move it away"
                raise OutputError(f"{target}: {_name(beside)} beside it {why}")
        for left in found:
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


def _clear(beside: Path, target: Path) -> None:
    """Remove the hidden folder; what was about to be replaced stays in it when it can't be put back."""
    with contextlib.suppress(OSError):
        _restore(beside / OLD, target)
    for name in (MADE, COLLECTED):
        with contextlib.suppress(OSError):
            _remove(beside / name)
    with contextlib.suppress(OSError):
        beside.rmdir()


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _find_foreign(path: Path) -> str | None:
    """Why `path` is not, or not only, what this command writes; None when it is."""
    try:
        if path.is_symlink():
            return NO_EXPORT
        if path.is_dir():
            return _find_foreign_entry(path)
        return None if path.is_file() and _is_file_of_ours(path) else NO_EXPORT
    except (
        OSError,
        ValueError,
        EOFError,
        KeyError,
        NotImplementedError,
        RuntimeError,
        zipfile.BadZipFile,
        zlib.error,
    ):
        return NO_EXPORT


def _find_foreign_entry(folder: Path) -> str | None:
    """Why a folder is not, or not only, what this command writes, by what lies in it; None when it is."""
    with os.scandir(folder) as found:
        entries = sorted(found, key=lambda entry: entry.name)
    if RECORDING_FILE not in (entry.name for entry in entries):
        return NO_EXPORT
    for entry in entries:
        if entry.name in FOLDERS | PAGE_FOLDERS:
            is_ours = entry.is_dir(follow_symlinks=False)
        else:
            is_ours = entry.name in (*PAGE_FILES, *DATA_FILES, RECORDING_FILE) and entry.is_file(
                follow_symlinks=False
            )
        if not is_ours:
            return (
                f"holds {_name(Path(entry.name))}, which no export wrote: move it away or name another folder"
            )
    with (folder / RECORDING_FILE).open("rb") as file:
        decode_recording(file.read(RECORDING_BYTES_MAX + 1))
    return None


def _is_file_of_ours(path: Path) -> bool:
    """Whether a file begins as this command's do. Raises ValueError, and what zipfile raises."""
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    match path.suffix.lower():
        case ".csv":
            return head.startswith((CSV_HEAD + b",", CSV_HEAD + b"\r\n"))
        case ".mcap":
            after = len(MCAP_MAGIC) + 9
            return head.startswith(MCAP_MAGIC + b"\1") and head[after:].startswith(MCAP_NAMES)
        case ".posecast":
            return _is_packed_recording(path)
    return False


def _is_packed_recording(path: Path) -> bool:
    """Whether a ZIP holds a recording, which is its first entry, and nothing but what belongs to one."""
    with zipfile.ZipFile(path) as packed:
        entries = packed.infolist()
        first = entries[0] if entries else None
        if first is None or first.filename != RECORDING_FILE or first.header_offset != 0:
            return False
        if any(each.filename.partition("/")[0] not in FOLDERS for each in entries[1:]):
            return False
        with packed.open(first) as entry:
            decode_recording(entry.read(RECORDING_BYTES_MAX + 1))
    return True


def _name(path: Path) -> str:
    return make_visible(path.name[:NAME_SHOWN])


WORTH_IT = 0.95  # an entry is deflated if that leaves less than this share of its bytes, else stored
DEFLATE_UP_TO_BYTES = 64 << 20
UNIX, PLAIN_FILE = 3, 0o100644 << 16


def pack_recording(
    folder: Path,
    recording: PastRecording,
    file: Path,
    report: Callable[[int, int], None] = lambda _done, _total: None,
) -> None:
    """Write the ZIP. First comes `recording.json`, then segments in their order, then all else by name.

    `report` is told how many files of how many are in it, after each. Raises OSError.
    """
    segments = [segment_path(each.take, each.index) for each in recording.segments]
    known = {RECORDING_FILE, *segments}
    others = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    names = (RECORDING_FILE, *segments, *sorted(name for name in others if name not in known))
    with zipfile.ZipFile(file, "w") as packed:
        for done, name in enumerate(names, 1):
            data = (folder / name).read_bytes()
            entry = zipfile.ZipInfo(name)  # of 1980: nothing of the clock
            entry.create_system, entry.external_attr = UNIX, PLAIN_FILE
            packed.writestr(entry, data, zipfile.ZIP_DEFLATED if _shrinks(data) else zipfile.ZIP_STORED, 6)
            report(done, len(names))


def _shrinks(data: bytes) -> bool:
    if len(data) > DEFLATE_UP_TO_BYTES:
        return False
    return len(zlib.compress(data, 6)) < WORTH_IT * len(data)
