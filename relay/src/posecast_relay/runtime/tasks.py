"""How work runs beside the event loop's other work: errors end only their own connection, simultaneous
requests share a task, and calls that may hang have their own threads.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable, Coroutine, Hashable
from functools import partial, wraps
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

FAULT = "internal error of the relay at this connection"


class Bounded(Protocol):
    """A connection that can end itself after an error."""

    def end_after_fault(self, error: Exception) -> None:
        """Report and count the error, tell the other side if still possible, and end. Raises nothing."""


B = TypeVar("B", bound=Bounded)


def isolated(callback: Callable[Concatenate[B, P], R]) -> Callable[Concatenate[B, P], R | None]:
    """Wrap a connection's callback, so that an exception ends the connection, not its caller."""

    @wraps(callback)
    def call(self: B, /, *args: P.args, **kwargs: P.kwargs) -> R | None:
        try:
            return callback(self, *args, **kwargs)
        except Exception as e:
            self.end_after_fault(e)
            return None

    return call


def isolated_task(
    work: Callable[Concatenate[B, P], Coroutine[Any, Any, R]],
) -> Callable[Concatenate[B, P], Coroutine[Any, Any, R | None]]:
    """Wrap a connection's coroutine, so that an exception ends the connection. Otherwise nobody would notice
    the task's errors."""

    @wraps(work)
    async def call(self: B, /, *args: P.args, **kwargs: P.kwargs) -> R | None:
        try:
            return await work(self, *args, **kwargs)
        except Exception as e:
            self.end_after_fault(e)
            return None

    return call


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


class BlockingCalls:
    """Runs blocking calls, at most `at_once` in parallel, each in a daemon thread; further ones wait.

    In asyncio's shared threads, a few calls that hang for minutes would stop everything else that needs
    these threads, and keep the process from exiting.
    """

    def __init__(self, at_once: int, name: str) -> None:
        """`name`: the threads' name, for debugging."""
        self._name = name
        self._free = asyncio.Semaphore(at_once)

    async def run(self, call: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Return the result of `call`. Raises what it raises.

        The caller may stop waiting at any time. The call itself still counts as running until it ends.
        """
        await self._free.acquire()
        ended: asyncio.Future[T] = asyncio.get_running_loop().create_future()

        def work() -> None:
            error, result = None, []
            try:
                result.append(call(*args, **kwargs))
            except BaseException as e:
                error = e
            with contextlib.suppress(RuntimeError):  # the loop has closed
                ended.get_loop().call_soon_threadsafe(self._end, ended, result, error)

        try:
            threading.Thread(target=work, daemon=True, name=self._name).start()
        except RuntimeError:  # the system allows no more threads
            self._free.release()
            raise
        return await asyncio.shield(ended)

    def _end(self, ended: asyncio.Future[T], result: list[T], error: BaseException | None) -> None:
        self._free.release()
        if error is None:
            ended.set_result(result[0])
        else:
            ended.set_exception(error)
            ended.exception()  # marks the error as retrieved: nobody may be waiting
