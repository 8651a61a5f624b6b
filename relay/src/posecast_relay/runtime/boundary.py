"""Confines errors to one connection: an exception in a callback ends only that connection."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from functools import wraps
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
    """Wrap a connection's coroutine likewise; otherwise its task's errors would go unnoticed."""

    @wraps(work)
    async def call(self: B, /, *args: P.args, **kwargs: P.kwargs) -> R | None:
        try:
            return await work(self, *args, **kwargs)
        except Exception as e:
            self.end_after_fault(e)
            return None

    return call
