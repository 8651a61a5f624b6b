"""What lies between a write and a viewer: kept small, and gone round where nothing waits."""

from __future__ import annotations

import asyncio
import socket

# What an unread socket swallows before it pushes back. Small, so that a slow viewer shows soon (the kernel
# takes twice the figure); large enough for a join in one go.
SEND_BUFFER_BYTES = 16384

# What the kernel takes of an answer beyond what is on its way: a quick reader gets more at once.
UNSENT_BYTES = 65536


def use_small_buffers(transport: asyncio.Transport) -> None:
    """So that the core hears of a slow viewer soon."""
    sock = transport.get_extra_info("socket")
    if sock is not None:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
    # at 0 the transport tells at once when a socket has not taken everything
    transport.set_write_buffer_limits(high=0)


def leave_unsent(transport: asyncio.Transport) -> None:
    """What the peer does not take waits in the transport: a kernel would swallow megabytes of it."""
    sock = transport.get_extra_info("socket")
    if sock is not None and sock.family != socket.AF_UNIX and hasattr(socket, "TCP_NOTSENT_LOWAT"):
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT_BYTES)
    transport.set_write_buffer_limits(high=0)


def cut_unread(sock: socket.socket, after_ms: int) -> None:
    """Whoever takes nothing of what waits for so long, or is not there any more, is cut by the kernel. Of a
    listener: whoever connects to it."""
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # not on macOS
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, after_ms)


def peer_of(transport: asyncio.BaseTransport) -> str:
    """Of whom, as an address; empty where there is none."""
    return str((transport.get_extra_info("peername") or ("",))[0])


def descriptor_of(transport: asyncio.Transport) -> int:
    """Of the socket, when all that is written to it goes out as it is; else −1."""
    sock = transport.get_extra_info("socket")
    if sock is None or transport.get_extra_info("sslcontext") is not None:
        return -1
    return int(sock.fileno())
