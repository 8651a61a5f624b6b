"""The directory in Redis: which robots are on air, and how many viewers they have in all processes.

Each process writes its part once a second and reads the whole directory in the same call. Times are from
Redis's clock, because hosts' clocks differ. Invalid entries are deleted or ignored.

    posecast:{-}:robots    hash: robot → time, its document; written by whoever hears it
    posecast:{-}:viewers   hash: process → time, viewers by robot
    posecast:{-}:ingests   hash: process that hears robots → time
"""

from __future__ import annotations

import contextlib
import json
import secrets
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from posecast_wire import check_name
from posecast_wire.checked import loads

from posecast_relay.redis.client import RedisClient, RedisClock

KEYS = ("posecast:{-}:robots", "posecast:{-}:viewers", "posecast:{-}:ingests")
FRESH_S = 4.0  # older entries of a process are ignored
INGEST_S = (
    2.5  # shorter than a robot goes unheard: first its relay is gone, then the robot's state is unknown
)
FORGET_S = 3600.0
ROW_BYTES_MAX = 1 << 19  # 5,000 viewers of as many robots need no more
VIEWERS_MAX = 1_000_000

BOARD = """
local t = redis.call('TIME')
local now = string.format('%d.%06d', t[1], t[2])
for k = 1, 3 do
  local kind = redis.call('TYPE', KEYS[k]).ok
  if kind ~= 'hash' and kind ~= 'none' then redis.call('DEL', KEYS[k]) end
end
local function put(key, field, text) redis.call('HSET', key, field, now .. ' ' .. text) end
put(KEYS[2], ARGV[1], ARGV[3])
if ARGV[2] == '1' then put(KEYS[3], ARGV[1], '') end
for i = 4, #ARGV, 2 do put(KEYS[1], ARGV[i], ARGV[i + 1]) end
local found, limits = {now}, { {forget}, {fresh}, {ingest} }
for k = 1, 3 do
  local kept = {}
  local all = redis.call('HGETALL', KEYS[k])
  for i = 1, #all, 2 do
    local at = tonumber(string.match(all[i + 1], '^%d+%.?%d*') or '')
    if not at or at < tonumber(now) - limits[k] or at > tonumber(now) + {fresh} then
      redis.call('HDEL', KEYS[k], all[i])
    else
      kept[#kept + 1] = all[i]
      kept[#kept + 1] = all[i + 1]
    end
  end
  redis.call('EXPIRE', KEYS[k], {forget})
  found[#found + 1] = kept
end
return found
"""
for name, limit_s in {"{forget}": FORGET_S, "{fresh}": FRESH_S, "{ingest}": INGEST_S}.items():
    BOARD = BOARD.replace(name, f"{limit_s:g}")


class RedisDirectory:
    """The directory as of the last exchange. `now` is this process's clock, in seconds."""

    def __init__(self, link: RedisClient, now: Callable[[], float]) -> None:
        self.id = secrets.token_hex(6)
        self.robots: dict[str, dict[str, Any]] = {}
        self.ages_s: dict[str, float] = {}  # of each robot's document
        self.ingests = 0  # processes that hear robots
        self.read_at = float("-inf")
        self.clock = RedisClock()
        self._link = link
        self._now = now
        self._elsewhere: dict[str, int] = {}

    def count_viewers_elsewhere(self, robot: str) -> int:
        """Return how many viewers a robot has at other processes."""
        return self._elsewhere.get(robot, 0)

    def list_documents(self) -> list[dict[str, Any]]:
        """Return the robots by name, with their present ages. A robot that no process hears is offline."""
        documents = []
        for robot, doc in sorted(self.robots.items()):
            age_s = self.ages_s[robot] + max(0.0, self._now() - self.read_at)
            aged = dict(doc)
            if doc.get("age_ms") is not None:
                aged["age_ms"] = doc["age_ms"] + round(age_s * 1000)
            if age_s > FRESH_S:
                aged["status"] = "offline"
            documents.append(aged)
        return documents

    async def exchange(
        self, viewers: Mapping[str, int], heard: Mapping[str, Mapping[str, Any]] | None
    ) -> None:
        """Write this process's viewers and the robots that it hears, and read those of all processes.

        `heard` None: this process hears no robots. Raises one of REDIS_ERRORS if Redis does not answer.
        """
        args: list[str] = [self.id, "0" if heard is None else "1", _compact(viewers)]
        for robot, doc in (heard or {}).items():
            args += [robot, _compact(doc)]
        asked_at = self._now()
        at, robots, counts, ingests = await self._link.run(BOARD, KEYS, *args)
        self.read_at = self._now()
        self.clock.record_time(float(at), asked_at, self.read_at)
        self.robots, self.ages_s, self._elsewhere = {}, {}, {}
        self.ingests = len(ingests) // 2
        for robot, written, doc in _rows(robots):
            if _is_summary(robot, doc):
                self.robots[robot] = doc
                self.ages_s[robot] = max(0.0, float(at) - written)
        for process, _, doc in _rows(counts):
            if process != self.id:
                for robot, count in doc.items():
                    if type(count) is int and 0 <= count <= VIEWERS_MAX:
                        self._elsewhere[robot] = self._elsewhere.get(robot, 0) + count


def _rows(flat: list[bytes]) -> Iterator[tuple[str, float, dict[str, Any]]]:
    """Yield the name, time and document of each valid row."""
    for name, text in zip(flat[::2], flat[1::2], strict=True):
        written, _, document = text.partition(b" ")
        with contextlib.suppress(ValueError, RecursionError):
            doc = loads(document) if len(document) <= ROW_BYTES_MAX else None
            if isinstance(doc, dict):
                _compact(doc).encode()  # 1e999 and half a surrogate pair are JSON that nobody can write again
                yield check_name("row", name.decode()), float(written), doc


def _is_summary(robot: str, doc: Mapping[str, Any]) -> bool:
    """Whether the document has the format of `make_robot_summary`."""
    age_ms = doc.get("age_ms")
    aged = age_ms is None or (type(age_ms) is int and 0 <= age_ms < 1 << 53)
    return aged and doc.get("robot") == robot and doc.get("status") in ("online", "silent", "offline")


def _compact(doc: Mapping[str, Any]) -> str:
    return json.dumps(doc, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
