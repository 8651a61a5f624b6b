"""Decides when a viewer may be written to and when it is cut, by what it acknowledges, reads and answers.

All times are seconds of the core's clock. Only this file writes these fields, except `sent`: the loop over
many viewers in `viewer.py` counts that as well.
"""

from __future__ import annotations

from posecast_wire import Close

from posecast_relay.core.limits import Limits
from posecast_relay.kit import TokenBucket


class FlowControl:
    """The flow control of one connection. Viewer inherits it to save one object access per frame."""

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
        "messages",
        "oldest_at",
        "oldest_n",
        "owed_at",
        "paused_at",
        "ping_at",
        "reliable_queue",
        "sent",
        "speaks",
        "stalled",
    )

    def __init__(self, limits: Limits, now: float, speaks: bool = True) -> None:
        self.limits = limits
        self.speaks = speaks  # whether it answers pings
        # reliable data that waits for the socket to drain; None = nothing
        self.reliable_queue: list[bytes] | None = None
        # blocked = nothing new may be written: not drained, acks owed, or that queue is not empty
        self.blocked = False
        self.paused_at: float | None = None
        self.stalled = False
        # still reading its first data, until it acknowledges more messages than those:
        self.join_burst_n = 0
        self.join_burst_arrives_by = now  # its limit if the viewer stays silent
        self.join_burst_read_by = now  # its limit while the viewer is heard from
        # acknowledgements
        self.sent = 0  # count of binary messages
        self.acks = False  # it has acknowledged once, so it can be expected to
        self.heard_ack_at = now
        self.owed_at: float | None = None  # when the first message was sent that must be acknowledged
        self.oldest_n = 0
        self.oldest_at: float | None = None  # when `oldest_n`, the oldest unacknowledged one, was sent
        self.check_at = float("inf")  # from when the next message makes it owe an ack, or stalls it
        # signs of life and message limits
        self.heard_at = now
        self.ping_at = now
        self.messages = TokenBucket(limits.messages_per_s, least=limits.messages_burst)

    # ---- the socket -------------------------------------------------------

    def pause(self, now: float) -> None:
        """Note that the viewer's socket buffer is full."""
        self.paused_at = now
        self.blocked = True

    def resume(self) -> None:
        """Note that the socket has drained. The viewer stays blocked until `release`."""
        self.paused_at = None

    def enqueue(self, data: bytes) -> bool:
        """Keep data that must arrive until `release`. Returns False if more is waiting than the limits
        allow."""
        if self.reliable_queue is None:
            self.reliable_queue = []
        self.reliable_queue.append(data)
        return len(self.reliable_queue) <= self.limits.reliable_queue

    def release(self) -> bytes | None:
        """Return the waiting data, which must be written first; None while the viewer can't take anything."""
        if self.paused_at is not None or self.stalled:
            return None
        waited = b"".join(self.reliable_queue or ())
        self.reliable_queue = None
        self.blocked = False
        return waited

    # ---- acknowledgements -------------------------------------------------

    def may_send(self, now: float) -> bool:
        """Whether another message may be sent before it acknowledges. Called when `check_at` has passed.

        A viewer acknowledges when a message arrives at least a second after its last acknowledgement. So the
        first message sent a second after that ack arrived is sure to be acknowledged, and always allowed.
        Without this, a viewer that had read everything in one go would owe nothing for it and never
        acknowledge again.
        """
        limits = self.limits
        if self.owed_at is None:
            if now < self.heard_ack_at + limits.ack_every_s:
                return False  # it acknowledges, but messages that are two seconds old
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
        """Note that a new viewer was sent `size` bytes at once, and give it time to read them."""
        limits = self.limits
        reads_s = size / limits.slowest_bytes_per_s
        self.join_burst_n = self.sent
        self.join_burst_arrives_by = now + min(limits.join_burst_s, max(0.0, reads_s - limits.undrained_s))
        self.join_burst_read_by = now + reads_s

    # ---- signs of life ----------------------------------------------------

    def record_heard(self, now: float) -> None:
        """Note that anything was received from the viewer."""
        self.heard_at = now

    def take_ping(self, now: float) -> bool:
        """Whether to ping the viewer now, because it was silent. If so, counts it as pinged."""
        if not self.speaks or now - max(self.heard_at, self.ping_at) < self.limits.ping_s:
            return False
        self.ping_at = now
        return True

    def allow_message(self, now: float) -> bool:
        """Whether the viewer may send one more message now. If so, counts it."""
        allowed = self.messages.has(1, now)
        if allowed:
            self.messages.take(1)
        return allowed

    def find_overdue(self, now: float) -> Close | None:
        """Return why this connection must be cut now, HALF_OPEN or NO_ACK; None if it may stay."""
        limits = self.limits  # a ping also waits behind its first data
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
        """Extend all deadlines, because the relay itself was stalled for this many seconds."""
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
