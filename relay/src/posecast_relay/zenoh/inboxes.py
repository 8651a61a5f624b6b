"""Queues messages from robots until the event loop takes them: one bounded inbox per robot, in turns."""

from __future__ import annotations

import threading
from collections import Counter, OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum

MESSAGES_MAX = 512  # in one inbox; then the oldest of the least important are dropped
BYTES_MAX = 1 << 21  # in one inbox; enough for one of the largest messages that Zenoh lets in
ROBOTS_MAX = 4096  # inboxes at once; messages of further robots are dropped
OTHERS = ""  # the name under which those messages are counted


class Importance(IntEnum):
    """What a full inbox drops first: the lowest."""

    FRAME = 0  # the next one replaces it
    ANSWER = 1  # a snapshot or an echo: the question is repeated
    EVENT = 2  # also info and changes of model: each is sent once
    TOKEN = 3  # without it, a robot that is silent counts as offline


@dataclass(slots=True)
class Message:
    """A message of `size` bytes. `take_in` processes it, on the event loop.

    `cost`: its processing time, in frames.
    """

    take_in: Callable[[], None]
    size: int
    importance: Importance
    cost: int = 1


@dataclass(slots=True)
class _Inbox:
    queues: dict[Importance, deque[tuple[int, Message]]] = field(default_factory=dict)  # none is empty
    count: int = 0
    size: int = 0

    def append(self, number: int, message: Message) -> None:
        """`number`: higher than that of any earlier message."""
        queue = self.queues.get(message.importance)
        if queue is None:
            queue = self.queues[message.importance] = deque()
        queue.append((number, message))
        self.count += 1
        self.size += message.size

    def pop_oldest(self) -> Message:
        queues = self.queues
        if len(queues) == 1:  # nearly always
            return self._pop(next(iter(queues)))
        return self._pop(min(queues, key=lambda importance: queues[importance][0][0]))

    def pop_least_important(self) -> Message:
        return self._pop(min(self.queues))

    def drop_frames(self) -> int:
        """Return how many were dropped."""
        frames = self.queues.pop(Importance.FRAME, ())
        self.count -= len(frames)
        self.size -= sum(message.size for _, message in frames)
        return len(frames)

    def _pop(self, importance: Importance) -> Message:
        queue = self.queues[importance]
        _, message = queue.popleft()
        if not queue:
            del self.queues[importance]
        self.count -= 1
        self.size -= message.size
        return message


class Inboxes:
    """One inbox per robot, filled by threads, emptied by the loop. A robot that floods loses only its own
    messages.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: OrderedDict[str, _Inbox] = OrderedDict()  # non-empty inboxes; the next one first
        self._number = 0  # of the newest message: they leave their inbox in this order
        self._closed_until: dict[str, float] = {}  # until then frames are dropped
        self._lost: Counter[str] = Counter()  # by robot

    def put(self, robot: str, message: Message, now: float) -> None:
        """Queue a message until its robot's turn. If the inbox is full, drop its oldest frames; if it has
        none, the oldest messages of the next importance.
        """
        with self._lock:
            if message.importance is Importance.FRAME and robot in self._closed_until:
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
            self._number += 1
            inbox.append(self._number, message)
            while inbox.count > MESSAGES_MAX or (inbox.size > BYTES_MAX and inbox.count > 1):
                inbox.pop_least_important()
                self._lost[robot] += 1

    def pop(self) -> Message | None:
        """Take the oldest message of the robot whose turn it is, if any. Then it is the next robot's turn."""
        with self._lock:
            if not self._waiting:
                return None
            robot, inbox = next(iter(self._waiting.items()))
            message = inbox.pop_oldest()
            if inbox.count:
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
            self._lost[robot] += inbox.drop_frames()
            if not inbox.count:
                del self._waiting[robot]

    def take_lost(self) -> Counter[str]:
        """Return how many messages were dropped since the last call, by robot."""
        with self._lock:
            lost, self._lost = self._lost, Counter()
            return lost

    def __bool__(self) -> bool:
        """Return whether any message waits."""
        return bool(self._waiting)
