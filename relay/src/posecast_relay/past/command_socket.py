"""The socket through which `posecast-relay past` reaches the memory of a running relay.

A Unix socket that only the relay's user may open: `--past-socket`, otherwise `posecast-relay-PORT.sock` in
$XDG_RUNTIME_DIR, otherwise none. A request and a response are one line of JSON each:

    {"do": "list"}                          {"rows": [[robot, view, day, from_ms, to_ms, bytes, segments], …]}
    {"do": "where"}                         {"store": "s3://BUCKET/PREFIX"}, or null: there is only memory
    {"do": "delete", "deletion": "{…}"}     {"segments": 12, "bytes": 34567}, or {"error": "…"}

A relay that also keeps the past in a store refuses to delete through this socket, because the store would
keep it. Deletions ordered in the store reach its memory too.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import socket
from pathlib import Path
from types import TracebackType

from posecast_wire.checked import loads

from posecast_relay.kit import json_bytes
from posecast_relay.past.deletions import Deletions, unpack_deletion
from posecast_relay.past.memory import MemoryPast
from posecast_relay.past.segment import DAY_MS

log = logging.getLogger("posecast_relay")

LINE_BYTES_MAX = 1 << 16
PATIENCE_S = 5.0  # to receive a whole line


class PastSocket:
    """Accepts requests at `path` while it is open. `store`: the URL of the store that also has the past."""

    def __init__(self, path: Path, kept: MemoryPast, deletions: Deletions, store: str | None = None) -> None:
        self._path = path
        self._kept = kept
        self._deletions = deletions
        self._store = store
        self._server: asyncio.Server | None = None

    async def __aenter__(self) -> PastSocket:
        """Open the socket. If that fails, log one line and go on without it."""
        try:
            self._server = await asyncio.start_unix_server(
                self._answer, sock=_bind(self._path), limit=LINE_BYTES_MAX
            )
        except OSError as e:
            log.warning("--past-socket %s: %s; `past delete` can't reach this process", self._path, e)

        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it, and remove its file."""
        if self._server is not None:
            self._server.close()
            self._server = None
            self._path.unlink(missing_ok=True)

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            async with asyncio.timeout(PATIENCE_S):
                line = await reader.readline()
                writer.write(self._carry_out(line) + b"\n")
                await writer.drain()
        except (ValueError, OSError, TimeoutError):  # too long, timed out, or disconnected
            pass
        finally:
            with contextlib.suppress(OSError):
                writer.close()

    def _carry_out(self, line: bytes) -> bytes:
        try:
            doc = loads(line)
            if isinstance(doc, dict) and doc.get("do") == "list":
                return json_bytes({"rows": self._list()})
            if isinstance(doc, dict) and doc.get("do") == "where":
                return json_bytes({"store": self._store})
            if isinstance(doc, dict) and doc.get("do") == "delete":
                if self._store is not None:
                    return json_bytes({"error": f"its past is also in a store: use --past {self._store}"})
                before = len(self._kept), self._kept.bytes
                self._deletions.add(unpack_deletion(str(doc.get("deletion")).encode()))
                return json_bytes(
                    {"segments": before[0] - len(self._kept), "bytes": before[1] - self._kept.bytes}
                )
        except ValueError as e:
            return json_bytes({"error": str(e)})
        return json_bytes({"error": "unknown request: want list, where or delete"})

    def _list(self) -> list[list[object]]:
        rows: dict[tuple[str, str, int], list[int]] = {}
        for robot in self._kept.list_robots():
            for view in self._kept.list_views(robot):
                for segment in self._kept.list_segments(robot, view):
                    row = rows.setdefault(
                        (robot, view, segment.from_ms // DAY_MS), [segment.from_ms, segment.to_ms, 0, 0]
                    )
                    row[0], row[1] = min(row[0], segment.from_ms), max(row[1], segment.to_ms)
                    row[2] += segment.size
                    row[3] += 1
        return [[robot, view, day, *row] for (robot, view, day), row in sorted(rows.items())]


def find_socket_path(given: Path | None, port: int) -> Path | None:
    """Return the path of the socket of a relay that listens on `port`; None if there is none."""
    folder = os.environ.get("XDG_RUNTIME_DIR")
    if given is None and folder and Path(folder).is_dir():
        return Path(folder) / f"posecast-relay-{port}.sock"
    return given


def _bind(path: Path) -> socket.socket:
    """Bind a socket that only this user may open, replacing the file of a killed process.

    Raises OSError.
    """
    opened = socket.socket(socket.AF_UNIX)
    try:
        if path.is_socket():
            if _is_served(path):
                raise OSError("another process listens on it")
            path.unlink()
        opened.bind(str(path))
        os.chmod(path, 0o600)  # nobody can connect before: it does not listen yet
    except BaseException:
        opened.close()
        raise
    return opened


def _is_served(path: Path) -> bool:
    """Whether a process listens at the Unix socket `path`. Does not wait. Raises OSError if it can't tell."""
    with socket.socket(socket.AF_UNIX) as probe:
        probe.setblocking(False)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            return False
        except BlockingIOError:  # its queue is full: it may have been stopped, and go on at any time
            return True
    return True
