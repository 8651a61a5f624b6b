"""Finds the program that listens on a port of this machine, if the system allows it."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

LISTENING = "0A"  # a state in /proc/net/tcp
LSOF_S = 5.0


def name_holder(port: int, proc: Path = Path("/proc")) -> str | None:
    """Return a text like `nginx (process 812)`; None if unknown. Only root sees other users' programs."""
    number = _find_by_proc(port, proc) if sys.platform == "linux" else _find_by_lsof(port)
    if number is None:
        return None
    name = _find_name(number, proc)
    return f"process {number}" if name is None else f"{name} (process {number})"


def explain_taken(error: OSError, port: int) -> str:
    """Return why a socket could not be opened, with the program that uses its port if that is known."""
    why = (error.strerror or str(error)).lower()
    holder = name_holder(port) if error.errno == errno.EADDRINUSE else None
    return f"{why} by {holder}" if holder else why


def _find_by_proc(port: int, proc: Path) -> int | None:
    sockets = {f"socket:[{inode}]" for inode in _list_inodes(port, proc)}
    if not sockets:
        return None
    for process in proc.glob("[0-9]*"):
        with suppress(OSError):  # another user's process, or it has ended
            for descriptor in (process / "fd").iterdir():
                with suppress(OSError):
                    if os.readlink(descriptor) in sockets:
                        return int(process.name)
    return None


def _list_inodes(port: int, proc: Path) -> list[str]:
    found = []
    for table in ("tcp", "tcp6"):
        with suppress(OSError):
            for line in (proc / "net" / table).read_text().splitlines()[1:]:
                words = line.split()
                if words[3] == LISTENING and int(words[1].rpartition(":")[2], 16) == port:
                    found.append(words[9])
    return found


def _find_by_lsof(port: int) -> int | None:
    """Find the process with `lsof`, which macOS includes."""
    command = ["lsof", "-nP", f"-iTCP:{port}", "-sTCP:LISTEN", "-t"]
    try:
        told = subprocess.run(command, capture_output=True, text=True, timeout=LSOF_S, check=False).stdout
    except (OSError, subprocess.TimeoutExpired):
        return None
    first = told.split()[:1]
    return int(first[0]) if first and first[0].isdigit() else None


def _find_name(process: int, proc: Path) -> str | None:
    try:
        if sys.platform == "linux":
            name = (proc / str(process) / "comm").read_text(errors="replace").strip()
        else:
            command = ["ps", "-o", "comm=", "-p", str(process)]
            told = subprocess.run(command, capture_output=True, text=True, timeout=LSOF_S, check=False).stdout
            name = told.strip().rpartition("/")[2]
    except (OSError, subprocess.TimeoutExpired):
        return None
    return "".join(c if c.isprintable() else "�" for c in name) or None
