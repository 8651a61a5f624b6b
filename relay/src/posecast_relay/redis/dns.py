"""Looks up a host's name in a separate thread, so that nothing else waits for the answer.

A resolver that does not answer blocks its caller for half a minute. The event loop's lookups would queue up
behind it, and the process could not exit meanwhile.
"""

from __future__ import annotations

import socket

from posecast_relay.runtime.tasks import BlockingCalls, SharedTasks


class HostLookup:
    """Looks up one host's name, in one thread at a time."""

    def __init__(self, host: str) -> None:
        self._host = host
        self._calls = BlockingCalls(1, "lookup")
        self._under_way = SharedTasks("lookup")

    async def find(self) -> None:
        """Return when the name is found.

        Raises OSError if it is not found. Callers may cancel the wait at any time.
        """
        await self._under_way.run(self._host, self._ask)

    async def _ask(self) -> None:
        try:
            await self._calls.run(socket.getaddrinfo, self._host, None, type=socket.SOCK_STREAM)
        except UnicodeError as e:  # not a valid name
            raise OSError(str(e)) from None
