"""The actions that the core returns. The caller carries them out in order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from posecast_wire import Close

from posecast_relay.core.state.stream import Stream
from posecast_relay.core.viewer.viewer import Viewer


@dataclass(slots=True)
class Send:
    """Write the same bytes to each of these viewers, in one write each."""

    data: bytes
    viewers: Sequence[Viewer]


@dataclass(slots=True)
class CloseConnection:
    """Send this viewer `bye` with the reason, then close. The core has removed it already.

    `lane`: where it may read on, as an address to be resolved against that of the stream.
    """

    viewer: Viewer
    close: Close
    reason: str
    retry_s: float | None
    lane: str | None = None


@dataclass(slots=True)
class Abort:
    """Drop this connection at once: a polite close cannot get through a full buffer."""

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
    """Listen for this robot, which has its first viewer.

    Only needed where robots are heard by other relays.
    """

    robot: str


@dataclass(slots=True)
class VerifyToken:
    """Verify a token that a connected viewer has sent, and decide anew what it may see."""

    viewer: Viewer
    token: str


@dataclass(slots=True)
class Fault:
    """Report an error in the relay's own code.

    The viewer or message concerned has been dealt with already.
    """

    where: str
    error: Exception


Action = Send | CloseConnection | Abort | RequestSnapshot | Persist | SubscribeRobot | VerifyToken | Fault
