"""What a simulated Redis holds, and the relays' scripts written a second time, in Python.

`test_redis_guard` plays those beside the real ones.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

from posecast_relay.redis.client import STATUS_MS, TTL_S
from posecast_relay.redis.directory import FORGET_S, FRESH_S, INGEST_S
from posecast_relay.redis.scripts import LEASE_MS
from redis.exceptions import ResponseError

WRONGTYPE = "WRONGTYPE Operation against a key holding the wrong kind of value"
WHOLE_MAX = 1 << 52
Value = bytes | dict[bytes, bytes]


def _bytes(value: object) -> bytes:
    return value if isinstance(value, bytes) else str(value).encode()


class Data:
    """What a server holds. `now_s` is its clock."""

    def __init__(self, now_s: Callable[[], float], publish: Callable[[bytes, bytes], None]) -> None:
        self.now_s = now_s
        self._publish = publish
        self._values: dict[bytes, Value] = {}
        self._ends: dict[bytes, float] = {}

    def all(self) -> list[bytes]:
        """The keys of what there is."""
        return [key for key in list(self._values) if self.value(key) is not None]

    def value(self, key: str | bytes) -> Value | None:
        """Of either kind."""
        name = _bytes(key)
        if self._ends.get(name, float("inf")) <= self.now_s():
            self.delete(name)
        return self._values.get(name)

    def delete(self, key: str | bytes) -> None:
        """If it is there."""
        self._values.pop(_bytes(key), None)
        self._ends.pop(_bytes(key), None)

    def flush(self) -> None:
        """All of it."""
        self._values.clear()
        self._ends.clear()

    def get(self, key: str) -> bytes | None:
        value = self.value(key)
        if isinstance(value, dict):
            raise ResponseError(WRONGTYPE)
        return value

    def set(self, key: str, value: object, ttl_s: float) -> None:
        self._values[_bytes(key)] = _bytes(value)
        self._ends[_bytes(key)] = self.now_s() + ttl_s

    def pttl(self, key: str) -> int:
        there = self.value(key) is not None
        return round((self._ends.get(_bytes(key), self.now_s()) - self.now_s()) * 1000) or -1 if there else -2

    def hash(self, key: str) -> dict[bytes, bytes]:
        value = self.value(key)
        if isinstance(value, bytes):
            raise ResponseError(WRONGTYPE)
        return {} if value is None else value

    def hset(self, key: str, *values: object) -> None:
        fields = self.hash(key)
        self._values[_bytes(key)] = fields
        fields |= {_bytes(name): _bytes(value) for name, value in zip(values[::2], values[1::2], strict=True)}

    def expire(self, key: str, ttl_s: float) -> None:
        if self.value(key) is not None:
            self._ends[_bytes(key)] = self.now_s() + ttl_s

    def hgetall(self, key: str) -> dict[bytes, bytes]:
        return dict(self.hash(key))

    def hmget(self, key: str, names: Sequence[str]) -> list[bytes | None]:
        fields = self.hash(key)
        return [fields.get(_bytes(name)) for name in names]

    # ---- the scripts --------------------------------------------------------

    def claim(self, keys: Sequence[str], args: Sequence[Any]) -> int:
        counter, writer, *states = keys
        if args != ["1"] and self._lease(writer) > 0:
            return 0
        newest = max(self._read(counter), self._read(writer))
        for state in states:
            newest = max(newest, _whole(self._fields(state, "generation")[0]))
        generation = max(newest + 1, int(self.now_s() * 1000))
        self.set(counter, generation, 2 * TTL_S)
        self.set(writer, generation, LEASE_MS / 1000)
        return generation

    def guard(self, keys: Sequence[str], args: Sequence[Any]) -> int:
        state, counter, channel, writer = keys
        generation, seq, full, key_id, message, *values = args
        if self._lease(writer) > generation:
            return 0
        has_generation, has_seq, has_key = self._fields(state, "generation", "seq", "key_id")
        known = _whole(has_generation)
        if known > generation or (known == generation and _whole(has_seq) > seq):
            return 3
        if full != "1" and (known != generation or has_key != _bytes(key_id)):
            return 2
        self.hset(state, "generation", generation, "seq", seq, "key_id", key_id, *values)
        if full == "1":
            self.expire(state, TTL_S)
            self.set(counter, max(self._read(counter), generation), 2 * TTL_S)
        self.set(writer, generation, LEASE_MS / 1000)
        self._publish(_bytes(channel), message)
        return 1

    def status(self, keys: Sequence[str], args: Sequence[Any]) -> int:
        status, channel, writer, counter, *states = keys
        generation, message = args
        if self._lease(writer) > generation:
            return 0
        self.set(status, message, STATUS_MS / 1000)
        self.set(writer, generation, LEASE_MS / 1000)
        self._publish(_bytes(channel), message)
        if states and self._read(counter) == 0:
            return 2
        return 1 if all(isinstance(self.value(state), dict) for state in states) else 2

    def board(self, keys: Sequence[str], args: Sequence[Any]) -> list[Any]:
        now = f"{self.now_s():.6f}"
        for key in keys:
            if isinstance(self.value(key), bytes):
                self.delete(key)
        self.hset(keys[1], args[0], f"{now} {args[2]}")
        if args[1] == "1":
            self.hset(keys[2], args[0], f"{now} ")
        for robot, doc in zip(args[3::2], args[4::2], strict=True):
            self.hset(keys[0], robot, f"{now} {doc}")
        found: list[Any] = [now.encode()]
        for key, limit_s in zip(keys, (FORGET_S, FRESH_S, INGEST_S), strict=True):
            fields = self.hash(key)
            for name, text in list(fields.items()):
                number = re.match(rb"\d+\.?\d*", text)
                at = float(number[0]) if number else -1.0
                if at < float(now) - limit_s or at > float(now) + FRESH_S:
                    del fields[name]
            self.expire(key, FORGET_S)
            found.append([part for field in fields.items() for part in field])
        return found

    def _lease(self, key: str) -> int:
        return self._read(key) if 0 < self.pttl(key) <= LEASE_MS else 0

    def _read(self, key: str) -> int:
        value = self.value(key)
        return _whole(value) if isinstance(value, bytes) else 0

    def _fields(self, key: str, *names: str) -> list[bytes | None]:
        if isinstance(self.value(key), bytes):
            self.delete(key)
        return self.hmget(key, names)


def _whole(text: bytes | None) -> int:
    try:
        number = float(text or b"")
    except ValueError:
        return 0
    return int(number) if 0 <= number < WHOLE_MAX and number == int(number) else 0
