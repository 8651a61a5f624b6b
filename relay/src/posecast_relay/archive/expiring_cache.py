"""A cache that is bounded in bytes and whose entries expire."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, NamedTuple, TypeVar

T = TypeVar("T")


class _Entry(NamedTuple):
    value: object
    cost_bytes: int
    until: float


class ExpiringCache(Generic[T]):
    """When its entries exceed `bytes_max`, it drops the least recently used ones."""

    def __init__(self, bytes_max: int) -> None:
        self.bytes = 0
        self._bytes_max = bytes_max
        self._entries: OrderedDict[Hashable, _Entry] = OrderedDict()

    def find(self, key: Hashable, now: float) -> T | None:
        """Return the value of a key if it is still valid at `now`, in seconds; otherwise None."""
        entry = self._entries.get(key)
        if entry is None or now >= entry.until:
            return None
        self._entries.move_to_end(key)
        return entry.value  # type: ignore[return-value]

    def put(self, key: Hashable, value: T, cost_bytes: int, until: float) -> None:
        """Keep a value until the given time, in seconds."""
        self._pop(key)
        self._entries[key] = _Entry(value, cost_bytes, until)
        self.bytes += cost_bytes
        while self.bytes > self._bytes_max and len(self._entries) > 1:
            self._pop(next(iter(self._entries)))

    def forget(self, is_gone: Callable[[Hashable], bool]) -> None:
        """Drop the entries for whose key `is_gone` returns True."""
        for key in [key for key in self._entries if is_gone(key)]:
            self._pop(key)

    def _pop(self, key: Hashable) -> None:
        entry = self._entries.pop(key, None)
        self.bytes -= 0 if entry is None else entry.cost_bytes
