"""One robot's share of the relay: how much it may send per second, so that it does not crowd out others.

A robot that exceeds its share loses some of its own frames, and its status says so. It is within its share
again as soon as it sends less.
"""

from __future__ import annotations

from posecast_relay.core.limits import Limits
from posecast_relay.kit import TokenBucket

OVER_FOR_S = 3.0  # after the last dropped message: a flood is one status, not one per frame
HASHED = 2  # a KEY costs twice its bytes: it is hashed and kept


class Share:
    """How much one robot may send. `dropped` counts its messages beyond that."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._messages = TokenBucket(limits.robot_messages_per_s)
        self._bytes = TokenBucket(limits.robot_bytes_per_s, least=HASHED * limits.frame_bytes)
        self._events = TokenBucket(limits.robot_events_per_s, least=limits.robot_events_burst)
        self._snapshot_bytes = TokenBucket(limits.snapshot_bytes_per_s, least=limits.snapshot_bytes_burst)
        self._views: dict[str, TokenBucket] = {}
        self.limit = ""  # the limit that was exceeded last
        self._over_until = float("-inf")
        self.dropped = 0

    def allow_frame(self, view: str, size: int, hashed: bool, now: float) -> bool:
        """Whether a frame of `size` bytes is within the share. If so, counts it."""
        frames = self._views.get(view)
        if frames is None:
            frames = self._views[view] = TokenBucket(self._limits.view_frames_per_s)
        cost = HASHED * size if hashed else size
        if not frames.has(1, now):
            return self._drop(f"{self._limits.view_frames_per_s:g} frames a second in a view", now)
        if not self.allow_message(cost, now):
            return False
        frames.take(1)
        return True

    def allow_message(self, size: float, now: float) -> bool:
        """Whether another message of `size` bytes is within the share. If so, counts it."""
        if not self._messages.has(1, now):
            return self._drop(f"{self._limits.robot_messages_per_s:g} messages a second", now)
        if not self._bytes.has(size, now):
            return self._drop(f"{self._limits.robot_bytes_per_s:,.0f} bytes a second", now)
        self._messages.take(1)
        self._bytes.take(size)
        return True

    def allow_event(self, size: float, now: float) -> bool:
        """Whether an event, info or model of `size` bytes is within the share. If so, counts it."""
        if not self._events.has(1, now):
            return self._drop(f"{self._limits.robot_events_per_s:g} events a second", now)
        if not self.allow_message(size, now):
            return False
        self._events.take(1)
        return True

    def allow_snapshot(self, size: int, now: float) -> bool:
        """Whether a snapshot of `size` bytes is within the share. If so, counts it.

        Snapshots have a limit of their own because parsing them costs more.
        """
        if not self._snapshot_bytes.has(size, now):
            return self._drop(f"{self._limits.snapshot_bytes_per_s:,.0f} bytes of snapshots a second", now)
        self._snapshot_bytes.take(size)
        return True

    def record_lost(self, count: int, reason: str, now: float) -> None:
        """Count messages that were dropped earlier because too many were queued. `reason`: the limit
        exceeded."""
        self.dropped += count
        self.limit = reason
        self._over_until = now + OVER_FOR_S

    def find_exceeded_limit(self, now: float) -> str:
        """Return the limit that the robot currently exceeds, as text; "" if none."""
        return self.limit if now < self._over_until else ""

    def _drop(self, reason: str, now: float) -> bool:
        self.record_lost(1, reason, now)
        return False
