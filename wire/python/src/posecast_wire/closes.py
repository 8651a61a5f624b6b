"""The reasons why a stream ends: every close code, and what the viewer does next (also
`wire/closes.json`)."""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import NamedTuple


class Close(IntEnum):
    """The WebSocket close codes that a viewer may receive; 1001 is sent by proxies only."""

    GOING_AWAY = 1001
    BINARY = 1003
    NOT_UTF8 = 1007
    NOT_ALLOWED = 1008
    TOO_LONG = 1009
    INTERNAL_ERROR = 1011
    DRAIN = 1012
    FULL = 1013
    AGE_LIMIT = 4000
    TOKEN = 4401
    FORBIDDEN = 4403
    ABSENT = 4404
    HALF_OPEN = 4408
    NO_ACK = 4409
    TOO_MANY = 4429
    EVENTS_FULL = 4430


class Retry(str, Enum):
    """What a viewer does after a stream has ended."""

    BACKOFF = "backoff"  # full jitter: random(0 … min(30 s, 0.5 s × 2^attempt))
    SPREAD = "spread"  # first after random(0 … retry_s of `bye`, 10 s if it has none), then backoff
    WAIT = "wait"  # not before retry_s of `bye` (30 s if it has none), then backoff
    LATER = "later"  # after random(30 … 60 s), each time: the robot may be added or come back
    NEVER = "never"  # not automatically: retrying can't help until a person acts


class Ending(NamedTuple):
    """Short name of a close code, a description for the viewer's user, and what the viewer does next."""

    name: str
    meaning: str
    retry: Retry


ENDINGS: dict[Close, Ending] = {
    Close.GOING_AWAY: Ending("going away", "a proxy on the way is stopping", Retry.SPREAD),
    Close.BINARY: Ending("binary", "a viewer sent a binary message; viewers send text only", Retry.NEVER),
    Close.NOT_UTF8: Ending("not UTF-8", "a viewer sent text that is not UTF-8", Retry.NEVER),
    Close.NOT_ALLOWED: Ending("not allowed", "a viewer sent a message the relay does not know", Retry.NEVER),
    Close.TOO_LONG: Ending("too long", "a viewer sent a message over 4 KiB", Retry.NEVER),
    Close.INTERNAL_ERROR: Ending(
        "internal error", "the relay had an internal error on this connection", Retry.BACKOFF
    ),
    Close.DRAIN: Ending("drain", "the relay is being replaced", Retry.SPREAD),
    Close.FULL: Ending("full", "the relay has no room for more viewers", Retry.WAIT),
    Close.AGE_LIMIT: Ending("age limit", "connections are renewed from time to time", Retry.SPREAD),
    Close.TOKEN: Ending("token", "the link or sign-in is missing, wrong or expired", Retry.NEVER),
    Close.FORBIDDEN: Ending("forbidden", "this viewer may not see this robot or view", Retry.NEVER),
    Close.ABSENT: Ending("absent", "there is no such robot here", Retry.LATER),
    Close.HALF_OPEN: Ending("half-open", "the viewer no longer answered", Retry.BACKOFF),
    Close.NO_ACK: Ending(
        "no acknowledgement", "the viewer left data unread or acknowledged nothing", Retry.BACKOFF
    ),
    Close.TOO_MANY: Ending("too many messages", "the viewer sent messages too fast", Retry.WAIT),
    Close.EVENTS_FULL: Ending("event queue full", "the viewer was too slow to receive events", Retry.BACKOFF),
}


def retry_of(code: int) -> Retry:
    """Return what to do after a close code. An unknown code (1006, or a proxy's) means BACKOFF."""
    known = code in Close._value2member_map_
    return ENDINGS[Close(code)].retry if known else Retry.BACKOFF
