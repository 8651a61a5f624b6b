"""What the core asks for: each call on it returns a list of these, to be carried out in order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from posecast_wire import Close

from posecast_relay.core.state.stream import Stream
from posecast_relay.core.viewer.viewer import Viewer


@dataclass(slots=True)
class Send:
    """The same ready-made bytes to each of these viewers, in one write each."""

    data: bytes
    viewers: Sequence[Viewer]


@dataclass(slots=True)
class CloseConnection:
    """Tell this viewer why (`bye`), then close. The core has let go of it already."""

    viewer: Viewer
    close: Close
    reason: str
    retry_s: float | None


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
    """This stream has changed: the store may want it."""

    stream: Stream


@dataclass(slots=True)
class SubscribeRobot:
    """This robot has its first viewer: a relay that hears robots from others listens for it from now on."""

    robot: str


@dataclass(slots=True)
class VerifyToken:
    """Find out whether this token, which a viewer sent while it watches, is good, and judge anew."""

    viewer: Viewer
    token: str


@dataclass(slots=True)
class Fault:
    """The relay's own code failed. What it was about is ended or dropped already; nobody else is touched."""

    where: str
    error: Exception


Action = Send | CloseConnection | Abort | RequestSnapshot | Persist | SubscribeRobot | VerifyToken | Fault
