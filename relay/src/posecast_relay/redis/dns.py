"""Looks up a host's name in a thread, so that nothing else has to wait for the answer.

A resolver that does not answer holds its caller for half a minute. The event loop's own lookups would pile up
behind it, and keep the process from ending as long.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading


class HostLookup:
    """Looks up one host's name, in one thread at a time that does not keep the process from ending."""

    def __init__(self, host: str) -> None:
        self._host = host
        self._under_way: asyncio.Future[None] | None = None

    async def find(self) -> None:
        """Return once the name is found.

        Raises OSError when it is not. Waiting may be cancelled at any time.
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
        except UnicodeError as e:  # no name at all
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
