"""Sets the sockets' buffers: small ones, so that the relay notices a slow viewer early."""

from __future__ import annotations

import asyncio
import socket

# How much an unread socket accepts before it blocks. Small, so that a slow viewer is noticed early (the
# kernel doubles the value); large enough for the messages of a join.
SEND_BUFFER_BYTES = 16384

# Of larger frames it accepts this many: a viewer whose processor is busy for a moment misses none. Beyond
# the second number, it accepts fewer: what a slow viewer has not read is old when it is read, and takes
# memory.
SEND_BUFFER_FRAMES = 6
SEND_BUFFER_BYTES_MAX = 65536

# How many unsent bytes of an answer the kernel buffers; a fast reader gets more at once.
UNSENT_BYTES = 65536


def use_small_buffers(transport: asyncio.Transport) -> None:
    """Use small buffers, so that the core notices a slow viewer early."""
    sock = transport.get_extra_info("socket")
    if sock is not None:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
    # at 0 the transport tells at once when a socket has not taken everything
    transport.set_write_buffer_limits(high=0)


def fit_buffer(transport: asyncio.Transport, frame_bytes: int) -> None:
    """Enlarge a stream's buffer if its frames are so large that it takes only a few of them."""
    wanted = min(SEND_BUFFER_FRAMES * frame_bytes, SEND_BUFFER_BYTES_MAX)
    sock = transport.get_extra_info("socket")
    if sock is not None and wanted > SEND_BUFFER_BYTES:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, wanted)


def leave_unsent(transport: asyncio.Transport) -> None:
    """Keep unread data in the transport; otherwise the kernel would buffer megabytes of it."""
    sock = transport.get_extra_info("socket")
    if sock is not None and hasattr(socket, "TCP_NOTSENT_LOWAT"):
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT_BYTES)
    transport.set_write_buffer_limits(high=0)


def cut_unread(sock: socket.socket, after_ms: int) -> None:
    """Let the kernel abort connections whose peer has accepted no data for `after_ms`, or is gone. For a
    listener, this applies to all its connections."""
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # not on macOS
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, after_ms)


def peer_of(transport: asyncio.BaseTransport) -> str:
    """Return the peer's address; "" if it has none."""
    return str((transport.get_extra_info("peername") or ("",))[0])


def descriptor_of(transport: asyncio.Transport) -> int:
    """Return the socket's descriptor if written data is sent unchanged (no TLS); else −1."""
    sock = transport.get_extra_info("socket")
    if sock is None or transport.get_extra_info("sslcontext") is not None:
        return -1
    return int(sock.fileno())
