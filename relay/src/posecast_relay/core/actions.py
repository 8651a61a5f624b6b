"""The actions that the core returns. The caller executes them in order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from posecast_wire import Close

from posecast_relay.core.stream import Stream
from posecast_relay.core.viewer import Viewer


@dataclass(slots=True)
class Send:
    """Write the same bytes to each of these viewers, with one write per viewer."""

    data: bytes
    viewers: Sequence[Viewer]


@dataclass(slots=True)
class CloseConnection:
    """Send this viewer `bye` with the reason, then close the connection. The core has already removed it.

    `lane` is where the viewer can read on: an address relative to that of the stream.
    """

    viewer: Viewer
    close: Close
    reason: str
    retry_s: float | None
    lane: str | None = None


@dataclass(slots=True)
class Abort:
    """Cut this connection at once: a polite close can't get through a full buffer."""

    viewer: Viewer
    close: Close


@dataclass(slots=True)
class RequestSnapshot:
    """Ask the edge for the snapshots of these views."""

    robot: str
    views: Sequence[str]


@dataclass(slots=True)
class Persist:
    """Tell the store that this stream has changed."""

    stream: Stream


@dataclass(slots=True)
class SubscribeRobot:
    """Subscribe to this robot, because its first viewer has joined.

    Only needed if other relays hear the robot.
    """

    robot: str


@dataclass(slots=True)
class VerifyToken:
    """Verify a token that a connected viewer sent, and decide again what the viewer may see."""

    viewer: Viewer
    token: str


@dataclass(slots=True)
class Fault:
    """Report an error in the relay's own code. The viewer or message concerned has already been handled."""

    where: str
    error: Exception


Action = Send | CloseConnection | Abort | RequestSnapshot | Persist | SubscribeRobot | VerifyToken | Fault
