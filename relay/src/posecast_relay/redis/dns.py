"""Looks up a host's name in a separate thread, so that nothing else waits for the answer.

A resolver that does not answer blocks its caller for half a minute. The event loop's lookups would queue up
behind it, and the process could not exit meanwhile.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading


class HostLookup:
    """Looks up one host's name, in one daemon thread at a time, which can't keep the process from exiting."""

    def __init__(self, host: str) -> None:
        self._host = host
        self._under_way: asyncio.Future[None] | None = None

    async def find(self) -> None:
        """Return when the name is found.

        Raises OSError if it is not found. Callers may cancel the wait at any time.
        """
        if self._under_way is None:
            self._under_way = asyncio.get_running_loop().create_future()
            threading.Thread(target=self._ask, args=(self._under_way,), daemon=True, name="lookup").start()
        await asyncio.shield(self._under_way)

    def _ask(self, under_way: asyncio.Future[None]) -> None:
        error: OSError | None = None
        try:
            socket.getaddrinfo(self._host, None, type=socket.SOCK_STREAM)
        except OSError as e:
            error = e
        except UnicodeError as e:  # not a valid name
            error = OSError(str(e))
        with contextlib.suppress(RuntimeError):  # the loop has closed
            under_way.get_loop().call_soon_threadsafe(self._answered, under_way, error)

    def _answered(self, under_way: asyncio.Future[None], error: OSError | None) -> None:
        self._under_way = None
        if error is None:
            under_way.set_result(None)
        else:
            under_way.set_exception(error)
            under_way.exception()  # seen, also when nobody waits any more
