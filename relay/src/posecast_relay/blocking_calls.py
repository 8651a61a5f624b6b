"""Runs blocking calls that may hang, such as those to another service, without taking threads from others."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


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
