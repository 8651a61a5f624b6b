"""One viewer: its mailbox of one (the frame it was given last), what it must get, what it holds, its acks."""

from __future__ import annotations

from typing import Protocol

from posecast_wire import Close

from posecast_relay.core.limits import Limits
from posecast_relay.core.policy.policy import Grant
from posecast_relay.core.state.stream import StoredFrame
from posecast_relay.core.viewer.cadence import granted_hz


class Outlet(Protocol):
    """A viewer's connection, as those who carry out actions need it. The core never calls it.

    `descriptor`: of the socket, while bytes may go straight to it; −1: only by `write`.
    """

    descriptor: int

    def write(self, data: bytes) -> None:
        """Hand these bytes to the socket."""

    def end(self, close: Close, reason: str, retry_s: float | None) -> None:
        """Say `bye`, then close."""

    def cut(self, close: Close) -> None:
        """Abort the connection."""


class Viewer:
    """What the core knows of one connection. Slots, since thousands of these are walked per frame."""

    __slots__ = (
        "acks",
        "asked_hz",
        "asked_view",
        "blocked",
        "check_at",
        "decoded",
        "expires_at",
        "frame",
        "grant",
        "heard_ack_at",
        "heard_at",
        "hz",
        "join_burst_arrives_by",
        "join_burst_n",
        "join_burst_read_by",
        "key",
        "limits",
        "max_hz",
        "number",
        "oldest_at",
        "oldest_n",
        "outlet",
        "owed_at",
        "paused_at",
        "ping_at",
        "ref",
        "reliable_queue",
        "robot",
        "schema_n",
        "sent",
        "speaks",
        "stalled",
        "tokens",
        "tokens_at",
        "until",
        "version",
        "view",
    )

    def __init__(
        self,
        outlet: Outlet,
        robot: str,
        view: str,
        hz: float,
        limits: Limits,
        now: float,
        lives_s: float = float("inf"),
        decoded: bool = False,
        speaks: bool = True,
        grant: Grant | None = None,
        asked_view: str | None = None,
    ) -> None:
        self.outlet = outlet
        self.number = 0  # of the connection, given by the hub
        self.robot = robot
        self.view = view
        self.grant = grant  # None: nobody asked for one
        self.asked_view = asked_view  # None: whichever the grant is for
        self.max_hz = min(limits.max_hz, grant.hz) if grant else limits.max_hz
        self.hz = granted_hz(hz, self.max_hz)
        self.asked_hz = self.hz  # served less often while the process is overloaded
        self.limits = limits
        self.until = now + lives_s
        self.expires_at = float("inf")  # what it has shown is worth nothing from then on
        self.decoded = decoded  # gets no bases: it counts one message per frame
        self.speaks = speaks  # answers pings
        # state: what it was given last, and which bases it holds
        self.frame: StoredFrame | None = None
        self.key: StoredFrame | None = None
        self.ref: StoredFrame | None = None
        self.version = -1  # of the stream's schema, info and model
        self.schema_n = -1
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

    def may_send(self, now: float) -> bool:
        """Called when `check_at` has passed: whether another message may go before it acknowledges.

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

    def acked(self, n: int, now: float) -> None:
        """It has received `n` binary messages."""
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
        self.settle()

    def paused(self, now: float) -> None:
        """Its socket did not take everything."""
        self.paused_at = now
        self.blocked = True

    def settle(self) -> None:
        """Work out `blocked` anew."""
        self.blocked = self.paused_at is not None or self.stalled or self.reliable_queue is not None

    def shift_deadlines(self, seconds: float, now: float) -> None:
        """The relay itself stood still for so long: what the viewer did meanwhile is still to be read."""
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

    def take_token(self, now: float) -> bool:
        """Whether it may send one more message now."""
        refill = (now - self.tokens_at) * self.limits.messages_per_s
        self.tokens = min(float(self.limits.messages_burst), self.tokens + refill)
        self.tokens_at = now
        if self.tokens < 1.0:
            return False
        self.tokens -= 1.0
        return True

    def overdue(self, now: float) -> Close | None:
        """Why this connection is to be cut now, if it is."""
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
