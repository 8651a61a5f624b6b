"""Small helpers of every package. They know no other package, and each call is given the time."""

from __future__ import annotations

import json
import math
from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Callable, Hashable
from heapq import heappop, heappush
from typing import Generic, NamedTuple, TypeVar


def write_count(number: int, noun: str) -> str:
    """Format a number and a noun, with a plural s unless the number is 1: 1 segment, 1,204 segments."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def json_bytes(document: object) -> bytes:
    """Encode compactly. NaN and infinity become null; an unpaired surrogate becomes a question mark."""
    try:
        text = json.dumps(document, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    except ValueError:
        text = json.dumps(_finite(document), separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.encode(errors="replace")


def _finite(value: object) -> object:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {name: _finite(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(each) for each in value]
    return value


T = TypeVar("T")
NEVER = float("inf")


class TimerQueue(Generic[T]):
    """A queue of items by due time. Taking the due items costs nothing for the others.

    It holds one due time per item, the earliest given. A caller that takes an item too early puts it back.
    """

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, T]] = []
        self._at: dict[T, float] = {}
        self._count = 0  # a tie-breaker for equal times

    def put(self, who: T, at: float) -> None:
        """Add an item due at `at` seconds, unless it is already due earlier."""
        if at < self._at.get(who, NEVER):
            self._at[who] = at
            self._count += 1
            heappush(self._heap, (at, self._count, who))

    def take_due(self, now: float, most: int | None = None) -> list[T]:
        """Remove and return the due items, at most `most` of them."""
        found: list[T] = []
        while self._heap and self._heap[0][0] <= now and len(found) != most:
            at, _, who = heappop(self._heap)
            if self._at.get(who) == at:
                del self._at[who]
                found.append(who)
        return found

    @property
    def next_at(self) -> float:
        """The earliest due time; NEVER if the queue is empty."""
        return self._heap[0][0] if self._heap else NEVER


BOUNDS_S = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0)


class Histogram:
    """Durations in seconds. `counts` has one more entry than BOUNDS_S, for durations above the last bound."""

    __slots__ = ("counts", "sum_s")

    def __init__(self) -> None:
        self.counts = [0] * (len(BOUNDS_S) + 1)
        self.sum_s = 0.0

    def add(self, seconds: float) -> None:
        """Count one duration, in seconds."""
        self.counts[bisect_left(BOUNDS_S, seconds)] += 1
        self.sum_s += seconds


BURST_S = 1.0  # what queued up while a relay or link stalled this long may arrive at once


class TokenBucket:
    """Allows `rate` units per second, and at once those of BURST_S seconds or `least`, whichever is more."""

    def __init__(self, rate: float, least: float = 1.0) -> None:
        self._rate = rate
        self._burst = max(rate * BURST_S, least)
        self._tokens = self._burst
        self._filled_at = float("-inf")

    def has(self, cost: float, now: float) -> bool:
        """Whether `cost` units are available now."""
        if now > self._filled_at:
            self._tokens = min(self._burst, self._tokens + (now - self._filled_at) * self._rate)
            self._filled_at = now
        return self._tokens >= cost

    def take(self, cost: float) -> None:
        """Take `cost` units that `has` found available."""
        self._tokens -= cost


CREDIT_S = 0.1  # frames arrive in bursts


class Turns:
    """Limits the work per robot, so that no robot's schema or viewers slow down the others."""

    def __init__(self, now: Callable[[], float], robot_per_s: int, all_per_s: int) -> None:
        """`now` is a clock in seconds. `robot_per_s`: work per second for one robot. `all_per_s`: for all
        robots, shared equally."""
        self._now = now
        self._robot_per_s = robot_per_s
        self._all_per_s = all_per_s
        self._next: dict[str, float] = {}  # by robot, not before
        self._tidied_at = float("-inf")

    def takes(self, robot: str, cost: int) -> bool:
        """Whether work of this cost may be done for this robot now. If so, it is counted."""
        now = self._now()
        if now - self._tidied_at >= 1.0:
            self._tidied_at = now
            self._next = {name: at for name, at in self._next.items() if at > now - 1.0}
        free_at = self._next.get(robot, 0.0)
        if now < free_at:
            return False
        share = min(self._robot_per_s, self._all_per_s / max(1, len(self._next)))
        self._next[robot] = max(free_at, now - CREDIT_S) + cost / share
        return True


FAILURES = 3  # in a row until requests stop
PAUSE_S = 5.0
PAUSE_MAX_S = 60.0


class Breaker:
    """Stops requests to a server that does not answer, and retries after a pause that doubles each time.

    closed (requests pass) → open (none pass, for a pause) → half open (one attempt decides).
    """

    def __init__(self) -> None:
        self.failures = 0  # in a row
        self.open_until = float("-inf")
        self._pause_s = PAUSE_S

    @property
    def is_open(self) -> bool:
        """Whether requests were stopped and none has succeeded since."""
        return self.failures >= FAILURES

    def allow(self, now: float) -> bool:
        """Whether a request may be made now."""
        return now >= self.open_until

    def record_success(self) -> bool:
        """Note that a request succeeded. Returns True if this ends a pause."""
        was_open = self.is_open
        self.failures, self._pause_s = 0, PAUSE_S
        return was_open

    def postpone(self, seconds: float) -> None:
        """Lengthen the current pause by this many seconds."""
        self.open_until += seconds

    def record_failure(self, now: float) -> bool:
        """Note that a request failed. Returns True if this failure stops further requests."""
        self.failures += 1
        if not self.is_open:
            return False
        self.open_until = now + self._pause_s
        self._pause_s = min(PAUSE_MAX_S, 2 * self._pause_s)
        return self.failures == FAILURES


CALM_S = 10.0  # without a failure until an outage is over; earlier failures belong to the same outage


class OutageLog:
    """Decides what the log says about an unreliable server: each reason once, and its recovery once.

    A few late answers on a busy machine count as one outage. `now` is in seconds of a monotonic clock.
    """

    def __init__(self) -> None:
        self._reported: set[str] = set()  # kinds of failure already logged in this outage
        self._failed_at = float("-inf")

    @property
    def is_open(self) -> bool:
        """Whether an outage is in progress."""
        return bool(self._reported)

    def note_failure(self, error: BaseException, now: float) -> str | None:
        """Note a failure. Returns its reason, or None if this outage already had such a failure."""
        self._failed_at = now
        kind = type(error).__name__
        if kind in self._reported:
            return None
        self._reported.add(kind)
        return str(error) or kind

    def note_success(self, now: float) -> bool:
        """Note a success. Returns True once, when it ends an outage: after CALM_S without a failure."""
        if not self._reported or now - self._failed_at < CALM_S:
            return False
        self._reported.clear()
        return True


class _Entry(NamedTuple):
    value: object
    cost: int
    until: float


class ExpiringCache(Generic[T]):
    """A cache whose entries expire. Beyond `cost_max`, it drops the least recently used ones.

    An entry's cost is in bytes, or 1 if entries are counted.
    """

    def __init__(self, cost_max: int) -> None:
        self.cost = 0
        self._cost_max = cost_max
        self._entries: OrderedDict[Hashable, _Entry] = OrderedDict()

    def __contains__(self, key: Hashable) -> bool:
        """Whether there is an entry, valid or not."""
        return key in self._entries

    def find(self, key: Hashable, now: float) -> T | None:
        """Return the value of a key if it is still valid at `now`, in seconds; otherwise None."""
        entry = self._entries.get(key)
        if entry is None or now >= entry.until:
            return None
        self._entries.move_to_end(key)
        return entry.value  # type: ignore[return-value]

    def put(self, key: Hashable, value: T, cost: int, until: float) -> None:
        """Keep a value until the given time, in seconds."""
        self._pop(key)
        self._entries[key] = _Entry(value, cost, until)
        self.cost += cost
        while self.cost > self._cost_max and len(self._entries) > 1:
            self._pop(next(iter(self._entries)))

    def forget(self, is_gone: Callable[[Hashable], bool]) -> None:
        """Drop the entries for whose key `is_gone` returns True."""
        for key in [key for key in self._entries if is_gone(key)]:
            self._pop(key)

    def _pop(self, key: Hashable) -> None:
        entry = self._entries.pop(key, None)
        self.cost -= 0 if entry is None else entry.cost


K = TypeVar("K")
V = TypeVar("V")


class RecentDict(dict[K, V]):
    """A dict of at most `most` entries: a further one takes the place of the oldest."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most

    def __setitem__(self, key: K, value: V) -> None:
        """Set the value of a key."""
        super().__setitem__(key, value)
        if len(self) > self._most:
            del self[next(iter(self))]


REFUSED_S = 15.0  # a repaired robot waits this long, unless its manifest has changed
REFUSED_MAX = 4096  # as many as a manifest has files, each under 1 kB


class RefusalMemory:
    """Remembers for some seconds which files from robots were refused, so that they are not fetched again.

    The relay notices a wrong file only after it has crossed the robot's uplink. Without this memory, repeated
    requests for such a file would fill the uplink.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        """`now` is a clock in seconds."""
        self._now = now
        self._kept: ExpiringCache[tuple[str, float]] = ExpiringCache(REFUSED_MAX)  # why, and until when

    def keep(self, name: Hashable, why: str) -> None:
        """Remember for REFUSED_S seconds why `name` was refused, in one line."""
        until = self._now() + REFUSED_S
        self._kept.put(name, (why, until), cost=1, until=until)

    def find(self, name: Hashable) -> tuple[str, float] | None:
        """Return why `name` was refused and for how many more seconds; None if it is not refused now."""
        now = self._now()
        kept = self._kept.find(name, now)
        return None if kept is None else (kept[0], kept[1] - now)
