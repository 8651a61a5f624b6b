"""What all packages of the agent use: printable text, the clock, logs that nobody can flood, rate limits."""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Callable
from typing import TypeVar

from posecast_wire.checked import escape_unseen

log = logging.getLogger("posecast_edge")

_T = TypeVar("_T")

# --- text from outside: one line, of bounded length, with no invisible characters

LINE_MAX = 600  # characters of a line
WORD_MAX = 60  # characters of a value quoted in a line


def make_visible(text: str, most: int = LINE_MAX) -> str:
    """Escape characters of `text` that are invisible or change the writing direction as Python does
    (`\u202e`), except where a script uses them, and cut the result to `most` characters."""
    shown = escape_unseen(text[: most + 1], _escape)
    return shown if len(shown) <= most else f"{shown[: most - 1]}…"


def _escape(c: str) -> str:
    return c.encode("unicode_escape").decode()


def quote(value: object, most: int = WORD_MAX) -> str:
    """`repr` of a value from outside for use in a message, cut to `most` characters. Never raises."""
    if isinstance(value, str):
        value = value[: most + 1]  # don't copy a long one whole
        if not value.isprintable():  # repr would escape what a script uses
            mark = '"' if "'" in value and '"' not in value else "'"
            inside = value.replace("\\", r"\\").replace(mark, f"\\{mark}")
            return make_visible(f"{mark}{inside}{mark}", most)
    try:
        shown = repr(value)
    except RecursionError:
        shown = f"a {type(value).__name__} nested too deep"
    except ValueError:  # Python refuses to print integers of more than 4300 digits
        shown = "a number with thousands of digits"
    return make_visible(shown, most)


def many(number: int, what: str) -> str:
    """`1 value`, `2 values`."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


# --- the agent's only clock. On Linux it keeps counting while the machine is suspended: a sample from before
# a laptop was closed counts as old when it is opened again, although `time.monotonic()` stops meanwhile. On
# other platforms it is `time.monotonic()`

_BOOTTIME: int | None = getattr(time, "CLOCK_BOOTTIME", None)


def now_ns() -> int:
    """Nanoseconds since an arbitrary moment; never goes backwards."""
    return time.monotonic_ns() if _BOOTTIME is None else time.clock_gettime_ns(_BOOTTIME)


def now_s() -> float:
    """Seconds since the same arbitrary moment as `now_ns`; never goes backwards."""
    return now_ns() / 1e9


# --- logs

SAY_EVERY_S = 10.0  # what goes wrong again and again is logged so often


class RateLimitedLog:
    """Logs one kind of message without flooding the log: the first at once, then a count each `every_s`.
    Times are arguments, in monotonic seconds."""

    def __init__(self, say: Callable[[str], None], noun: str, every_s: float = 1.0) -> None:
        self._say = say
        self._noun = noun
        self._every_s = every_s
        self._logged_s: float | None = None
        self._held = 0
        self._newest = ""
        self.total = 0

    def add(self, text: str, now_s: float) -> None:
        """Log `text` now when nothing was logged in the last second; otherwise only count it."""
        self.total += 1
        if self._logged_s is None or (self._held == 0 and now_s - self._logged_s >= self._every_s):
            self._logged_s = now_s
            self._say(text)
            return
        self._held += 1
        self._newest = text
        self.tick(now_s)

    def tick(self, now_s: float) -> None:
        """Log the count of messages held back when a second has passed since the last line."""
        if self._held and self._logged_s is not None and now_s - self._logged_s >= self._every_s:
            self.flush(now_s)

    def flush(self, now_s: float) -> None:
        """Log the count of messages held back now, if there are any."""
        if self._held:
            self._say(f"{self._held} more {self._noun}, the newest: {self._newest}")
            self._held = 0
            self._logged_s = now_s


NAMED_MAX = 100  # parts
PART_MAX = 200  # characters of a part that are compared
FIRST_COUNT = 10  # of problems that were not named; then 100, 1000, …
_NUMBER = re.compile(r"\d+")


class PartLog:
    """Names each bad part of the input once, and counts the rest: what stays bad must not flood the
    log. `say` is called with each line; `noun`: what is counted. Not thread-safe."""

    def __init__(self, say: Callable[[str], None], noun: str) -> None:
        self._say = say
        self._noun = noun
        self._named: set[str] = set()
        self._held = 0
        self._logged = 0  # of those
        self._newest = ""

    def add(self, part: str, text: str) -> None:
        """Log `text` if this part was not named before; otherwise count it. `part`: what is bad and how, the
        same each time."""
        part = part[:PART_MAX]
        if part not in self._named and len(self._named) < NAMED_MAX:
            self._named.add(part)
            more = f"; further {self._noun} are only counted" if len(self._named) == NAMED_MAX else ""
            self._say(f"{text}{more}")
            return
        self._held += 1
        self._newest = text
        if self._held >= max(FIRST_COUNT, 10 * self._logged):
            self.flush()

    def flush(self) -> None:
        """Log how many have been counted, at the end."""
        if self._held > self._logged:
            self._logged = self._held
            self._say(f"{self._held} more {self._noun}, the newest: {self._newest}")


def kind_of(text: str) -> str:
    """The part of a problem that has no name: its text without numbers, which differ each time."""
    return _NUMBER.sub("#", text)


class OnceLog:
    """Logs each thing once and does not count it again; at most `most` things. `noun`: what they are."""

    def __init__(self, say: Callable[[str], None], most: int | None = None, noun: str = "ones") -> None:
        self._say, self._most, self._noun = say, most, noun
        self._logged: set[str] = set()

    def add(self, text: str, part: str = "") -> None:
        """Log `text`, unless its `part` has been logged before: what stays the same if the text shows values
        that change; by default, what precedes its first colon."""
        part = part or text.partition(":")[0]
        if part not in self._logged and len(self._logged) != self._most:
            self._logged.add(part)
            more = f"; further {self._noun} are not logged" if len(self._logged) == self._most else ""
            self._say(make_visible(f"{text}{more}"))

    def has_logged(self, part: str) -> bool:
        """Whether a text of this part has been logged."""
        return part in self._logged


class ExceptionLog:
    """Counts and logs exceptions that must not reach other parts of the agent, by the place that raised them.
    May be used from any thread."""

    def __init__(self, say: Callable[[str], None] = log.warning) -> None:
        self._say = say
        self._by_place: dict[str, RateLimitedLog] = {}

    def add(self, place: str, error: BaseException) -> None:
        """Count and log an exception. `place` is one of a few fixed words that say where it was raised."""
        log.debug("%s", place, exc_info=error)
        text = f"{place}: {type(error).__name__}: {make_visible(str(error), 200)}"
        self.get_log(place).add(text, time.monotonic())

    def count(self, place: str) -> int:
        """How many exceptions this place has raised so far."""
        return self.get_log(place).total

    def get_log(self, place: str) -> RateLimitedLog:
        """The rate-limited log for the exceptions of one place."""
        return self._by_place.setdefault(
            place, RateLimitedLog(self._say, f"exceptions in {place}", SAY_EVERY_S)
        )

    def guard(self, place: str, call: Callable[[_T], None]) -> Callable[[_T], None]:
        """Wrap `call` as a library's callback: an exception is logged under `place` and never reaches the
        library."""

        def guarded_call(argument: _T) -> None:
            try:
                call(argument)
            except Exception as e:
                self.add(place, e)

        return guarded_call


# --- rates


class TokenBucket:
    """Limits work requested by others to a steady rate with a bounded burst. Holds at most `most` tokens and
    gains `per_s` of them a second. Times are monotonic seconds."""

    def __init__(self, per_s: float, most: float) -> None:
        self._per_s = per_s
        self._most = most
        self._left = most
        self._at_s: float | None = None

    def take(self, now_s: float, cost: float = 1.0) -> bool:
        """Spend `cost` tokens and return True if the bucket has enough. A cost above `most` is allowed when
        the bucket is full."""
        if self.compute_wait_s(now_s, cost) > 0:
            return False
        self._left -= cost
        return True

    def compute_wait_s(self, now_s: float, cost: float = 1.0) -> float:
        """Seconds until `cost` tokens may be spent; 0 when they may be spent now."""
        passed_s = 0.0 if self._at_s is None else max(0.0, now_s - self._at_s)
        self._left, self._at_s = min(self._most, self._left + self._per_s * passed_s), now_s
        return max(0.0, (min(cost, self._most) - self._left) / self._per_s)


PAUSE_FIRST_S = 0.2
PAUSE_LONGEST_S = 5.0
STEADY_S = 5.0  # a connection that lasted this long resets the pause


class Backoff:
    """Decides when to retry a connection. Doubles the pause with every failure; starts again with the
    shortest one after a connection that lasted STEADY_S. Times are monotonic seconds."""

    def __init__(self) -> None:
        self._pause_s = PAUSE_FIRST_S
        self._next_s = float("-inf")
        self._connected_s: float | None = None

    def is_due(self, now_s: float) -> bool:
        """Whether to try now."""
        return now_s >= self._next_s

    def record_success(self, now_s: float) -> None:
        """Record that a connection was made."""
        self._connected_s = now_s

    def record_failure(self, now_s: float) -> None:
        """Record that an attempt failed or a connection ended, and plan the next attempt."""
        if self._connected_s is not None and now_s - self._connected_s >= STEADY_S:
            self._pause_s = PAUSE_FIRST_S
        self._connected_s = None
        self._next_s = now_s + self._pause_s
        self._pause_s = min(PAUSE_LONGEST_S, self._pause_s * 2)
