"""One viewer: who it is, its rate, its mailbox of one, the last frame it was sent; and its flow control.

Flow control decides when a viewer may be written to and when it is cut, by what it acknowledges, reads and
answers. All times are seconds of the core's clock.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from posecast_wire import Close, clamp_hz

from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import Grant
from posecast_relay.core.stream import StoredFrame
from posecast_relay.kit import TokenBucket


class FlowControl:
    """The flow control of one connection. Viewer inherits it to save one object access per frame.

    Only its methods write these fields, except `sent`: the loop over many viewers in Viewer counts that as
    well.
    """

    __slots__ = (
        "acknowledges",
        "blocked",
        "check_at",
        "heard_ack_at",
        "heard_at",
        "held_back",
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
    )

    def __init__(self, limits: Limits, now: float, speaks: bool = True) -> None:
        self.limits = limits
        self.speaks = speaks  # whether it answers pings
        # reliable data that waits for the socket to drain; None = nothing
        self.reliable_queue: list[bytes] | None = None
        # blocked = nothing new may be written: not drained, acks owed, or that queue is not empty
        self.blocked = False
        self.paused_at: float | None = None
        self.held_back = False  # it owes an acknowledgement for too long
        # still reading its first data, until it acknowledges more messages than those:
        self.join_burst_n = 0
        self.join_burst_arrives_by = now  # its limit if the viewer stays silent
        self.join_burst_read_by = now  # its limit while the viewer is heard from
        # acknowledgements
        self.sent = 0  # count of binary messages
        self.acknowledges = False  # it has once, of any number, so it can be expected to
        self.heard_ack_at = now
        self.owed_at: float | None = None  # when the first message was sent that must be acknowledged
        self.oldest_n = 0
        self.oldest_at: float | None = None  # when `oldest_n`, the oldest unacknowledged one, was sent
        self.check_at = float("inf")  # from when the next message makes it owe an ack, or is held back
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
        if self.paused_at is not None or self.held_back:
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
            self.check_at = min(now + limits.ack_hold_s, max(self.oldest_at + limits.backlog_s, now))
            return True
        self.held_back = True
        self.blocked = True
        return False

    def record_ack(self, n: int, now: float) -> None:
        """Note that the viewer has received `n` binary messages.

        Any `n` settles the debt, even an old or a false one: the viewer is alive, and by a false number it
        harms only itself.
        """
        self.acknowledges = True
        self.heard_ack_at = now
        if n > self.join_burst_n:
            self.join_burst_arrives_by = min(now, self.join_burst_arrives_by)
            self.join_burst_read_by = min(now, self.join_burst_read_by)
        self.owed_at = None
        self.held_back = False
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
        beyond_s = max(0.0, reads_s - limits.undrained_s)  # that much patience every silent viewer has
        self.join_burst_arrives_by = now + min(limits.join_burst_s, beyond_s)
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
        if self.owed_at is not None and now - max(came, self.owed_at) >= limits.ack_cut_s:
            return Close.NO_ACK
        patience = limits.undrained_acking_s if self.acknowledges else limits.undrained_s
        if self.paused_at is not None and now - max(came, self.paused_at) >= patience:
            return Close.NO_ACK
        return None

    def shift_deadlines(self, seconds: float, now: float) -> None:
        """Extend all deadlines, because the relay itself stood still for this many seconds. A new
        clock of this class must be moved here, too."""
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


def grant_hz(asked_hz: float, most_hz: float) -> float:
    """Return the rate in Hz that a viewer gets. Rates go in steps, so that there are at most about 300.

    The steps are 0.01 Hz up to 1 Hz, 0.1 Hz up to 10 Hz, then 0.5 Hz. 0 stays 0; any other rate is at least
    0.1 Hz.
    """
    hz = clamp_hz(max(0.0, min(asked_hz, most_hz)))
    steps_per_hz = 100 if hz < 1 else 10 if hz < 10 else 2
    return min(round(hz * steps_per_hz) / steps_per_hz, clamp_hz(most_hz))


class Outlet(Protocol):
    """A viewer's connection, for the code that executes actions. The core never calls it.

    `descriptor`: the socket's, while bytes may be written straight to it; −1: use `write` only.
    """

    descriptor: int

    def write(self, data: bytes) -> None:
        """Write these bytes to the socket."""

    def end(self, close: Close, reason: str, retry_s: float | None, lane: str | None = None) -> None:
        """Send `bye`, then close."""

    def cut(self, close: Close) -> None:
        """Abort the connection."""


class Viewer(FlowControl):
    """One viewer's connection as the core sees it. It has slots because a frame visits thousands of them."""

    __slots__ = (
        "asked_hz",
        "asked_view",
        "decoded",
        "expires_at",
        "frame",
        "grant",
        "hz",
        "key",
        "max_hz",
        "number",
        "outlet",
        "robot",
        "schema_n",
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
        expires_at: float = float("inf"),
    ) -> None:
        super().__init__(limits, now, speaks)
        self.outlet = outlet
        self.number = 0  # of the connection, assigned by the hub
        self.robot = robot
        self.view = view
        self.grant = grant  # None: access was not checked
        self.asked_view = asked_view  # None: the one that the grant names
        self.max_hz = min(limits.max_hz, grant.hz) if grant else limits.max_hz
        self.hz = grant_hz(hz, self.max_hz)
        self.asked_hz = self.hz  # the effective rate is lower while the process is overloaded
        self.until = now + lives_s
        self.expires_at = expires_at  # when its token expires
        self.decoded = decoded  # gets no KEY: it expects one message per frame
        # state: what it was sent last, and which KEY it holds
        self.frame: StoredFrame | None = None
        self.key: StoredFrame | None = None
        self.version = -1  # of the stream's schema, info and model
        self.schema_n = -1

    # ---- identity and rate ------------------------------------------------

    def set_number(self, number: int) -> None:
        """Set the number of its connection, assigned by the hub."""
        self.number = number

    def set_grant(self, grant: Grant) -> bool:
        """Set what it may see. Returns True if that lowers its requested rate."""
        self.grant = grant
        self.max_hz = min(self.limits.max_hz, grant.hz)
        if self.asked_hz <= self.max_hz:
            return False
        self.set_asked_rate(self.max_hz)
        return True

    def set_expiry(self, expires_at: float) -> None:
        """Set when its token expires, in seconds of the core's clock."""
        self.expires_at = expires_at

    def set_asked_rate(self, hz: float) -> None:
        """Set the rate in Hz that it requests, within its grant. `set_rate` makes it effective."""
        self.asked_hz = grant_hz(hz, self.max_hz)

    def set_rate(self, hz: float) -> None:
        """Set the rate in Hz at which it is served. Room calls this, because it groups viewers by rate."""
        self.hz = hz

    # ---- mailbox ----------------------------------------------------------

    def record_description(self, version: int, schema_n: int) -> None:
        """Note that it was sent the stream's schema, info and model of this version."""
        self.version, self.schema_n = version, schema_n

    def record_frame(self, frame: StoredFrame) -> None:
        """Note that it was sent `frame`, after its KEY if it lacked that."""
        if frame.key is not None and self.key is not frame.key and not self.decoded:
            self.sent += 1
        self.sent += 1
        self.key = frame if frame.is_key else frame.key
        self.frame = frame

    @staticmethod
    def share_frame(
        viewers: Iterator[Viewer],
        frame: StoredFrame,
        version: int,
        now: float,
        ready: list[Viewer],
        lacking: list[Viewer],
        behind: set[Viewer],
    ) -> list[tuple[Viewer, Exception]]:
        """Sort due viewers by what they need. Returns those for which this failed, with the error.

        Viewers with the KEY and the description of this `version` go to `ready`, and count as having been
        sent `frame`. Those that need more go to `lacking`, and those that can't take it now go to `behind`.
        It is one function because a call per viewer and frame would take too long.
        """
        failed: list[tuple[Viewer, Exception]] = []
        key = frame if frame.is_key else frame.key
        while True:  # restarts after each viewer for which it fails
            try:
                for viewer in viewers:
                    if viewer.frame is frame:
                        continue
                    if viewer.blocked or (now >= viewer.check_at and not viewer.may_send(now)):
                        behind.add(viewer)
                    elif viewer.version == version and (key is frame or viewer.key is key):
                        ready.append(viewer)
                        viewer.sent += 1
                        viewer.frame = frame
                        viewer.key = key
                    else:
                        lacking.append(viewer)
                break
            except Exception as error:
                if failed and failed[-1][0] is viewer:
                    raise  # the loop itself failed, not a viewer
                failed.append((viewer, error))
        return failed
