"""What fails when nobody waits for it any more."""

from __future__ import annotations

import asyncio
import logging
from typing import Any

log = logging.getLogger("posecast_relay")


class Unheard:
    """The event loop's exception handler: one line with what failed and where. How often, the log counts.

    A connection that was given up (Redis, too slow) may fail afterwards: not again until another reason
    comes.
    """

    def __init__(self) -> None:
        self._said = ""

    def __call__(self, _loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """As asyncio calls it."""
        why = context.get("exception")
        transport = context.get("transport")
        # what still came over TLS is answered into a transport that is closed already
        is_late = isinstance(why, RuntimeError) and transport is not None and transport.is_closing()
        if not is_late and not (isinstance(why, OSError) and "future" in context):
            log.error("%s", context.get("message") or "not caught", exc_info=why)
        elif str(why) != self._said:
            self._said = str(why)
            log.warning("a connection that took too long: %s", why)
