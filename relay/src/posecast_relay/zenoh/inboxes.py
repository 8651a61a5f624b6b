"""Queues messages from robots until the event loop takes them: one bounded inbox per robot, in turns."""

from __future__ import annotations

import threading
from collections import Counter, OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, field

MESSAGES_MAX = 512  # in one inbox; then the oldest are dropped
BYTES_MAX = 1 << 21  # likewise; enough for one of the largest messages that Zenoh lets in
ROBOTS_MAX = 4096  # inboxes at once; messages of further robots are dropped
OTHERS = ""  # the name under which those messages are counted


@dataclass(slots=True)
class Message:
    """A message of `size` bytes. `take_in` processes it, on the event loop.

    `cost`: its processing time, in frames. `is_frame`: it can be dropped, because a newer frame replaces it.
    """

    take_in: Callable[[], None]
    size: int
    is_frame: bool = False
    cost: int = 1


@dataclass(slots=True)
class _Inbox:
    messages: deque[Message] = field(default_factory=deque)
    size: int = 0


class Inboxes:
    """One inbox per robot, filled by threads, emptied by the loop. A robot that floods loses only its own
    messages.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: OrderedDict[str, _Inbox] = OrderedDict()  # non-empty inboxes; the next one first
        self._closed_until: dict[str, float] = {}  # until then frames are dropped
        self._lost: Counter[str] = Counter()  # by robot

    def put(self, robot: str, message: Message, now: float) -> None:
        """Queue a message until its robot's turn. If the inbox is full, drop its oldest messages."""
        with self._lock:
            if message.is_frame and robot in self._closed_until:
                if now < self._closed_until[robot]:
                    self._lost[robot] += 1
                    return
                del self._closed_until[robot]
            inbox = self._waiting.get(robot)
            if inbox is None:
                if len(self._waiting) >= ROBOTS_MAX:
                    self._lost[OTHERS] += 1
                    return
                inbox = self._waiting[robot] = _Inbox()
            inbox.messages.append(message)
            inbox.size += message.size
            while len(inbox.messages) > MESSAGES_MAX or (inbox.size > BYTES_MAX and len(inbox.messages) > 1):
                inbox.size -= inbox.messages.popleft().size
                self._lost[robot] += 1

    def pop(self) -> Message | None:
        """Take the oldest message of the robot whose turn it is, if any. Then it is the next robot's turn."""
        with self._lock:
            if not self._waiting:
                return None
            robot, inbox = next(iter(self._waiting.items()))
            message = inbox.messages.popleft()
            inbox.size -= message.size
            if inbox.messages:
                self._waiting.move_to_end(robot)
            else:
                del self._waiting[robot]
            return message

    def close(self, robot: str, now: float, until: float) -> None:
        """Drop this robot's queued frames, and those that arrive before `until`. Times are in seconds."""
        with self._lock:
            if len(self._closed_until) >= ROBOTS_MAX:  # remove robots that never sent another frame
                self._closed_until = {r: end for r, end in self._closed_until.items() if now < end}
            self._closed_until[robot] = until
            inbox = self._waiting.get(robot)
            if inbox is None:
                return
            kept = deque(m for m in inbox.messages if not m.is_frame)
            self._lost[robot] += len(inbox.messages) - len(kept)
            inbox.messages, inbox.size = kept, sum(m.size for m in kept)
            if not kept:
                del self._waiting[robot]

    def take_lost(self) -> Counter[str]:
        """Return how many messages were dropped since the last call, by robot."""
        with self._lock:
            lost, self._lost = self._lost, Counter()
            return lost

    def __bool__(self) -> bool:
        """Return whether any message waits."""
        return bool(self._waiting)
