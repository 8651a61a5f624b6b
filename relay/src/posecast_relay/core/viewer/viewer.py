"""One viewer: who it is, its rate, and its mailbox of one, the last frame it was sent."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from posecast_wire import Close

from posecast_relay.core.limits import Limits
from posecast_relay.core.policy.policy import Grant
from posecast_relay.core.state.stream import StoredFrame
from posecast_relay.core.viewer.cadence import grant_hz
from posecast_relay.core.viewer.flow_control import FlowControl


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

    @property
    def is_preview(self) -> bool:
        """Whether it is a card in a list: it is not counted as a viewer and gets no events."""
        return self.grant is not None and self.grant.is_preview

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
