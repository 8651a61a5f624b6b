"""Shares a task among simultaneous requests for the same thing."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Hashable
from functools import partial
from typing import Any, TypeVar

T = TypeVar("T")


class SharedTasks:
    """Running tasks, by key. A task runs to its end even if nobody waits for it anymore."""

    def __init__(self, name: str) -> None:
        """`name`: the tasks' name, for debugging."""
        self._name = name
        self._running: dict[Hashable, asyncio.Task[Any]] = {}

    async def run(self, key: Hashable, start: Callable[[], Coroutine[Any, Any, T]]) -> T:
        """Wait for the task of this key; start it if there is none. Raises what the task raises."""
        task: asyncio.Task[T] | None = self._running.get(key)
        if task is None:
            task = self._running[key] = asyncio.create_task(start(), name=self._name)
            task.add_done_callback(partial(self._forget, key))
        return await asyncio.shield(task)

    def list_running(self) -> list[asyncio.Task[Any]]:
        """Return the tasks that run."""
        return list(self._running.values())

    def _forget(self, key: Hashable, task: asyncio.Task[Any]) -> None:
        del self._running[key]
        if not task.cancelled():
            task.exception()  # marks the error as retrieved: nobody may be waiting
