"""Decides whether a robot is online, silent or offline, by its edge's token and its newest frame's age."""

from __future__ import annotations

from posecast_wire.messages import RobotStatus

REVIVE_S = 1.0  # a frame this long after the token vanished means that the edge is alive


class Liveness:
    """Follows one robot's token.

    `online`: frames arrive; `silent`: the edge is connected but sends no frames; `offline`: the edge is gone.
    """

    def __init__(self) -> None:
        self.token = False
        self._lost_at = float("-inf")

    def set_token(self) -> None:
        """Note that the edge's token has appeared."""
        self.token = True

    def clear_token(self, now: float) -> None:
        """Note that the edge's token is gone: it stopped, crashed, or was disconnected for longer than the
        lease.
        """
        self.token = False
        self._lost_at = now

    def compute_status(self, live_at: float | None, age_s: float | None, silent_s: float) -> RobotStatus:
        """Return the robot's status.

        `live_at`: when the newest live frame arrived; `age_s`: its age, including transit; `silent_s`: the
        age from which a robot counts as silent. All in seconds.
        """
        fresh = age_s is not None and age_s <= silent_s
        if not self.token:
            # two edges with one robot id share a token: the remaining one still sends frames
            revived = fresh and live_at is not None and live_at > self._lost_at + REVIVE_S
            return "online" if revived else "offline"
        return "online" if fresh else "silent"
