"""Where one connection ends and the next begins: what a callback raises ends its own connection, by name."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

FAULT = "a fault of the relay's own at this connection"


class Bounded(Protocol):
    """A connection that ends by itself when something in it fails."""

    def end_after_fault(self, error: Exception) -> None:
        """Say so where that is still possible, count it, and end. Raises nothing."""


B = TypeVar("B", bound=Bounded)


def isolated(callback: Callable[Concatenate[B, P], R]) -> Callable[Concatenate[B, P], R | None]:
    """A callback of a connection: nothing that it raises reaches its caller, which serves others as well."""

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
    """The same for what a connection does in a task of its own, whose errors nobody would hear of."""

    @wraps(work)
    async def call(self: B, /, *args: P.args, **kwargs: P.kwargs) -> R | None:
        try:
            return await work(self, *args, **kwargs)
        except Exception as e:
            self.end_after_fault(e)
            return None

    return call
