"""A local entrance to a relay that Zenoh can't reach on its own: through an HTTP proxy, or under a name apart
from its address. It speaks TLS to the relay, and verifies the relay's certificate.

The entrance is a Unix socket in a folder of this user, and only this process may enter: whoever entered
could use the robot's certificate.
"""

from __future__ import annotations

import os
import select
import shutil
import socket
import struct
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from posecast_edge.uplink.credentials import Certificate, Proof, make_tls_context
from posecast_edge.uplink.route import ProxyError, RelayRoute

if TYPE_CHECKING:
    import ssl

CONNECT_S = 5.0  # a step of a connection: TCP, the proxy's answer, TLS
AGAIN_S = 30.0  # after a proxy's refusal: too many wrong logins may lock an account
SILENT_MS = 30_000
CHUNK_BYTES = 8192
# small kernel buffers: on a slow uplink, a queue only adds delay
SNDBUF_BYTES = 32768
LOCAL_SNDBUF_BYTES = 8192
ENTRANCES_MAX = 4  # one for each authority that credentials name; the oldest is closed
PEERCRED = struct.Struct("3i")  # pid, uid, gid


class Tunnel:
    """Entrances to one relay. Each connection has a thread of its own."""

    def __init__(self, route: RelayRoute, warn: Callable[[str], None]) -> None:
        """`warn` is called with a line when a process is turned away that may not enter."""
        self._route, self._warn = route, warn
        self._lock = threading.Lock()
        self._folder: Path | None = None
        self._entrances: dict[object, tuple[Path, socket.socket]] = {}
        self._made = 0
        self._refusal = ""
        self._refused_s = 0.0

    @property
    def refusal(self) -> str:
        """Why the proxy refuses, while it is not asked again; "" otherwise."""
        return self._refusal if time.monotonic() < self._refused_s + AGAIN_S else ""

    def open(self, proof: Proof | None) -> str:
        """The Zenoh endpoint of the entrance for connections with this proof. Raises OSError when there is no
        place for its socket."""
        # the password is Zenoh's concern: TLS depends on the authority, or on the certificate's files
        key: object = proof if proof is None or isinstance(proof, Certificate) else proof.ca
        with self._lock:
            if key not in self._entrances:
                while len(self._entrances) >= ENTRANCES_MAX:
                    _close(*self._entrances.pop(next(iter(self._entrances))))
                self._entrances[key] = self._make(proof)
            path, _ = self._entrances[key]
        return f"unixsock-stream/{path}"

    def close(self) -> None:
        """Close the entrances. Connections end with Zenoh's sessions."""
        with self._lock:
            for path, listener in self._entrances.values():
                _close(path, listener)
            self._entrances.clear()
            folder, self._folder = self._folder, None
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)

    def _make(self, proof: Proof | None) -> tuple[Path, socket.socket]:
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="posecast-"))  # mode 0700
        self._made += 1
        path = self._folder / f"relay{self._made}"
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            listener.bind(str(path))
            listener.listen()
        except OSError:
            listener.close()
            raise
        threading.Thread(
            target=self._accept, args=(listener, path, proof), name="tunnel", daemon=True
        ).start()
        return path, listener

    def _accept(self, listener: socket.socket, path: Path, proof: Proof | None) -> None:
        while True:
            try:
                near, _ = listener.accept()
            except OSError:  # closed
                return
            stranger = _find_stranger(near)
            if stranger is not None:
                self._warn(f"process {stranger} may not use this robot's connection to {self._route}")
                near.close()
                continue
            _limit_sender(path)
            threading.Thread(target=self._carry, args=(near, proof), name="tunnel", daemon=True).start()

    def _carry(self, near: socket.socket, proof: Proof | None) -> None:
        """Carry one connection until either side ends it. A failure ends it at once: Zenoh tries again, and
        diagnosis.py finds out why."""
        with near, suppress(OSError, UnicodeError):
            if self.refusal:
                return
            try:
                far = self._route.connect(CONNECT_S)
            except ProxyError as e:
                if e.is_answer:
                    self._refusal, self._refused_s = str(e), time.monotonic()
                raise
            with far:
                far.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SNDBUF_BYTES)
                far.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                if hasattr(socket, "TCP_USER_TIMEOUT"):  # so that a link that went silent ends
                    far.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, SILENT_MS)
                with make_tls_context(proof).wrap_socket(
                    far, server_hostname=self._route.expected_name
                ) as link:
                    _copy(near, link)


def _close(path: Path, listener: socket.socket) -> None:
    with suppress(OSError):  # wakes accept(), which a close alone does not
        listener.shutdown(socket.SHUT_RDWR)
    listener.close()
    path.unlink(missing_ok=True)


def _find_stranger(near: socket.socket) -> int | None:
    """The id of the process at the other end, if it is not this one."""
    peercred = getattr(socket, "SO_PEERCRED", None)  # Linux only; elsewhere the folder's mode protects it
    if peercred is None:
        return None
    pid: int = PEERCRED.unpack(near.getsockopt(socket.SOL_SOCKET, peercred, PEERCRED.size))[0]
    return None if pid == os.getpid() else pid


def _limit_sender(path: Path) -> None:
    """Limit the kernel buffer of Zenoh's end, which has no setting for it. It is in this process: the socket
    whose peer is `path`. Where there is no /proc, the buffer stays as it is."""
    try:
        numbers = [int(name) for name in os.listdir("/proc/self/fd")]
    except OSError:
        return
    for number in numbers:
        try:
            end = socket.socket(fileno=number)
        except OSError:  # no socket, or closed meanwhile
            continue
        try:
            if end.family == socket.AF_UNIX and end.getpeername() == str(path):
                end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, LOCAL_SNDBUF_BYTES)
        except OSError:
            pass
        finally:
            end.detach()  # it stays Zenoh's


def _copy(near: socket.socket, far: ssl.SSLSocket) -> None:
    """Copy both ways until either side ends. Never holds more than a chunk for each direction."""
    import ssl  # noqa: PLC0415 - loaded already; over 1 MB for agents without a tunnel

    near.setblocking(False)
    far.setblocking(False)
    up = down = b""
    while True:
        wanted = {near: 0, far: 0}
        wanted[far if up else near] |= select.POLLOUT if up else select.POLLIN
        wanted[near if down else far] |= select.POLLOUT if down else select.POLLIN
        poll = select.poll()
        for end, events in wanted.items():
            if events:  # an end that hangs up wakes every poll
                poll.register(end, events)
        if down or not far.pending():  # what TLS has decrypted already wakes no poll
            poll.poll()
        with suppress(BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
            if up:
                up = up[far.send(up) :]
            elif not (up := near.recv(CHUNK_BYTES)):
                break
        with suppress(BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
            if down:
                down = down[near.send(down) :]
            elif not (down := far.recv(CHUNK_BYTES)):
                break
    with suppress(OSError):  # says that the connection has ended, without waiting for an answer
        far.unwrap()
