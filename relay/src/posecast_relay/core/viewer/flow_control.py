"""Decides when a viewer may be written to and when it is cut, by what it acknowledges, reads and answers.

All times are seconds of the core's clock. Only this file writes these fields, but for `sent`: that one the
walk over a crowd counts as well (`viewer.py`).
"""

from __future__ import annotations

from posecast_wire import Close

from posecast_relay.core.limits import Limits


class FlowControl:
    """The flow control of one connection. Viewer inherits it: one object less to reach, for every frame."""

    __slots__ = (
        "acks",
        "blocked",
        "check_at",
        "heard_ack_at",
        "heard_at",
        "join_burst_arrives_by",
        "join_burst_n",
        "join_burst_read_by",
        "limits",
        "oldest_at",
        "oldest_n",
        "owed_at",
        "paused_at",
        "ping_at",
        "reliable_queue",
        "sent",
        "speaks",
        "stalled",
        "tokens",
        "tokens_at",
    )

    def __init__(self, limits: Limits, now: float, speaks: bool = True) -> None:
        self.limits = limits
        self.speaks = speaks  # answers pings
        # what must arrive and waits for the socket to drain; None = nothing
        self.reliable_queue: list[bytes] | None = None
        # blocked = nothing new may be written now: not drained, acks owed, or that queue not empty
        self.blocked = False
        self.paused_at: float | None = None
        self.stalled = False
        # reading what it was given when it came, until it acknowledges more messages than those:
        self.join_burst_n = 0
        self.join_burst_arrives_by = now  # till then without a word
        self.join_burst_read_by = now  # till then as long as it is heard of
        # acknowledgements
        self.sent = 0  # binary messages
        self.acks = False  # it has acknowledged once, so it will
        self.heard_ack_at = now
        self.owed_at: float | None = None  # when the first message went that is sure to be acknowledged
        self.oldest_n = 0
        self.oldest_at: float | None = None  # when message `oldest_n` went, the oldest of those that is not
        self.check_at = float("inf")  # when the next message sent makes it owe one, or stalls it
        # signs of life and manners
        self.heard_at = now
        self.ping_at = now
        self.tokens = float(limits.messages_burst)
        self.tokens_at = now

    # ---- the socket -------------------------------------------------------

    def pause(self, now: float) -> None:
        """Note that the viewer's socket did not take everything."""
        self.paused_at = now
        self.blocked = True

    def resume(self) -> None:
        """Note that the socket has taken everything. The viewer stays blocked until `release`."""
        self.paused_at = None

    def enqueue(self, data: bytes) -> bool:
        """Keep data that must arrive until `release`. False: more waits than the limits allow."""
        if self.reliable_queue is None:
            self.reliable_queue = []
        self.reliable_queue.append(data)
        return len(self.reliable_queue) <= self.limits.reliable_queue

    def release(self) -> bytes | None:
        """Return what waited, which has to be written first; None while the viewer can't take anything."""
        if self.paused_at is not None or self.stalled:
            return None
        waited = b"".join(self.reliable_queue or ())
        self.reliable_queue = None
        self.blocked = False
        return waited

    # ---- acknowledgements -------------------------------------------------

    def may_send(self, now: float) -> bool:
        """Whether another message may be sent before it acknowledges. Called when `check_at` has passed.

        A viewer acknowledges when a message arrives and a second has passed since its last acknowledgement.
        So the first message sent a second after that was heard here is sure to be answered, and is always let
        through: a viewer that had read all in one go owes nothing for the rest, and would never speak again.
        """
        limits = self.limits
        if self.owed_at is None:
            if now < self.heard_ack_at + limits.ack_every_s:
                return False  # its acknowledgements come, but for messages of two seconds ago
            self.owed_at = now
            if self.oldest_at is None:
                self.oldest_at = now
                self.oldest_n = self.sent + 1
            self.check_at = min(now + limits.ack_stop_s, max(self.oldest_at + limits.backlog_s, now))
            return True
        self.stalled = True
        self.blocked = True
        return False

    def record_ack(self, n: int, now: float) -> None:
        """Note that the viewer has received `n` binary messages."""
        self.acks = True
        self.heard_ack_at = now
        if n > self.join_burst_n:
            self.join_burst_arrives_by = min(now, self.join_burst_arrives_by)
            self.join_burst_read_by = min(now, self.join_burst_read_by)
        self.owed_at = None
        self.stalled = False
        self.check_at = now + self.limits.ack_every_s
        if self.oldest_at is not None:
            if min(n, self.sent) >= self.oldest_n:
                self.oldest_at = None
            else:
                self.check_at = min(self.check_at, self.oldest_at + self.limits.backlog_s)
        self.blocked = self.paused_at is not None or self.reliable_queue is not None

    def begin_join_burst(self, size: int, now: float) -> None:
        """Note that a new viewer was sent `size` bytes at once, and allow it time to read them."""
        limits = self.limits
        reads_s = size / limits.slowest_bytes_per_s
        self.join_burst_n = self.sent
        self.join_burst_arrives_by = now + min(limits.join_burst_s, max(0.0, reads_s - limits.undrained_s))
        self.join_burst_read_by = now + reads_s

    # ---- signs of life ----------------------------------------------------

    def record_heard(self, now: float) -> None:
        """Note that anything came from the viewer."""
        self.heard_at = now

    def take_ping(self, now: float) -> bool:
        """Whether to ping the viewer now, since nothing came from it; if so, it counts as pinged."""
        if not self.speaks or now - max(self.heard_at, self.ping_at) < self.limits.ping_s:
            return False
        self.ping_at = now
        return True

    def allow_message(self, now: float) -> bool:
        """Whether the viewer may send one more message now; if so, it is counted."""
        refill = (now - self.tokens_at) * self.limits.messages_per_s
        self.tokens = min(float(self.limits.messages_burst), self.tokens + refill)
        self.tokens_at = now
        if self.tokens < 1.0:
            return False
        self.tokens -= 1.0
        return True

    def find_overdue(self, now: float) -> Close | None:
        """Return why this connection has to be cut now, HALF_OPEN or NO_ACK; None when it may stay."""
        limits = self.limits  # a ping, too, waits behind what it reads at first
        came = max(self.join_burst_arrives_by, min(self.heard_at, self.join_burst_read_by))
        if self.speaks and now - max(came, self.heard_at) >= limits.half_open_s:
            return Close.HALF_OPEN
        if self.owed_at is not None and now - max(came, self.owed_at) >= limits.ack_abort_s:
            return Close.NO_ACK
        patience = limits.undrained_acking_s if self.acks else limits.undrained_s
        if self.paused_at is not None and now - max(came, self.paused_at) >= patience:
            return Close.NO_ACK
        return None

    def shift_deadlines(self, seconds: float, now: float) -> None:
        """Extend all deadlines, since the relay itself stood still for this many seconds."""
        self.heard_at = min(now, self.heard_at + seconds)
        self.join_burst_arrives_by += seconds
        self.join_burst_read_by += seconds
        self.check_at += seconds
        self.heard_ack_at = min(now, self.heard_ack_at + seconds)
        if self.owed_at is not None:
            self.owed_at += seconds
        if self.oldest_at is not None:
            self.oldest_at += seconds
        if self.paused_at is not None:
            self.paused_at += seconds
