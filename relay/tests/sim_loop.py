"""An event loop whose clock is the test's: hours pass in seconds, and the same history plays the same way."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


class SimLoop(asyncio.BaseEventLoop):
    """Knows timers and callbacks, no sockets. Nothing waits: the clock jumps to the next timer."""

    def __init__(self) -> None:
        super().__init__()
        self._selector = self
        self._clock_resolution = 1e-9
        self._time_s = 1000.0
        self._calls = 0
        self.faults: list[
            dict[str, Any]
        ] = []  # what reached the loop instead of whoever should have dealt with it
        self.set_exception_handler(lambda _, context: self.faults.append(context))

    def time(self) -> float:
        """Simulated seconds."""
        return self._time_s

    def call_at(  # type: ignore[override]
        self, when: float, *about: Any, **how: Any
    ) -> asyncio.TimerHandle:
        """Those of one moment come in the order in which they were asked for."""
        self._calls = (self._calls + 1) % 10_000
        return super().call_at(when + self._calls * 1e-10, *about, **how)

    def select(self, timeout_s: float | None) -> list[Any]:
        """As the loop asks its selector: wait so long for a socket."""
        assert timeout_s is not None, "everything waits for what can't come"
        self._time_s += max(0.0, timeout_s)
        return []

    def _process_events(self, event_list: list[Any]) -> None:
        assert not event_list

    def _write_to_self(self) -> None:
        """Nobody sleeps."""

    def run(self, work: Coroutine[Any, Any, T]) -> T:
        """Until it is done; other tasks go on meanwhile."""
        return self.run_until_complete(work)

    def pass_time(self, seconds: float) -> None:
        """Let so much time pass."""
        self.run(asyncio.sleep(seconds))

    def end(self) -> None:
        """Cancel what still runs, and close."""
        going = asyncio.all_tasks(self)
        for task in going:
            task.cancel()
        if going:
            self.run(_ended(going))
        self.close()


async def _ended(tasks: set[asyncio.Task[Any]]) -> None:
    await asyncio.gather(*tasks, return_exceptions=True)
