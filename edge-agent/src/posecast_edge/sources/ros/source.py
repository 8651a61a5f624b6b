"""The common base of the live ROS sources."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from posecast_edge.sources.ros.input import RosInput

if TYPE_CHECKING:
    from posecast_edge.model.moving_joints import MovingJoint


class RosSource:
    """The base of ROS sources. `intake` turns messages into samples."""

    def __init__(self, intake: RosInput) -> None:
        self._intake = intake

    @property
    def offers(self) -> list[str]:
        """Lines for `probe` about the topics found."""
        return self._intake.list_topics()

    def send_urdf_to(self, take: Callable[[str], None]) -> None:
        """Pass every new robot_description (URDF text) to `take`, in the source's thread."""
        self._intake.on_urdf = take

    def watch_frames(self) -> None:
        """Read /tf even if no profile asks for it, so that `offers` can list its frames."""
        self._intake.frames.watch()
        self._intake.watch_frames()

    def take_joints(self, joints: Sequence[MovingJoint]) -> None:
        """Read these joints of the shown model from /tf if no joint states arrive."""
        self._intake.frames.joints.set_joints(joints)

    def expect_joints(self) -> None:
        """Do nothing: a live source need not wait, since messages before `take_joints` would be outdated."""
