"""Reads a robot's base pose from /tf and /tf_static, and its joints if there are no joint states. Live
sources and recordings both use it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from posecast_edge.sources.ros.joint_frames import JointFrames
from posecast_edge.sources.ros.merge import MessageMerger
from posecast_edge.sources.ros.messages import TF, Report, read_transforms
from posecast_edge.sources.ros.transforms import TransformTree

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile

STATES_S = 2.0  # how long to wait for joint states if they have a topic
TOPIC = "/tf"
JOINTS_TOPIC = "/tf (joints)"  # its name in the merger


class RobotFrames:
    """Takes the transforms of one robot and reports to `merge`. `profile`: its `[ros] base` names the two
    frames of the base; joints are not read if it lacks the field `pos`. `namespace`: see JointFrames; `say`
    is called with a line for each problem."""

    def __init__(
        self,
        profile: Profile | None,
        merge: MessageMerger,
        say: Callable[[str], None],
        namespace: str = "",
    ) -> None:
        base = profile.ros.base_frames if profile and profile.ros else None
        self.tree = TransformTree(base, say)
        pos = profile.find_field("pos") if profile else None
        self.joints = JointFrames(say, namespace, frozenset(pos.labels) if pos else None)
        self._reads_base = base is not None
        self._wants_joints = profile is None or pos is not None
        self._merge = merge
        self._began_s: float | None = None
        self._states_known = False  # there is a topic of joint states
        self._states_heard = False
        self._names: list[str] | None = None  # of the announced joints
        self._watched = False

    def watch(self) -> None:
        """Take all transforms, for `list_lines`."""
        self._watched = True

    def expect_states(self) -> None:
        """There is a topic of joint states. May be called from any thread."""
        self._states_known = True

    def note_report(self, role: str, report: Report) -> None:
        """Note a message of another topic: after the first joint state with positions, joints are no longer
        read from /tf."""
        if role == "pos" and not self._states_heard and "pos" in report.values:
            self._states_heard = True
            self._merge.forget_topic(JOINTS_TOPIC)

    def reads_joints(self, now_s: float, least_s: float = 0.0) -> bool:
        """Whether joints are read from /tf, because no joint states arrive. `least_s`: the earliest time of
        that, in seconds after the first call."""
        if self._began_s is None:
            self._began_s = now_s
        wait_s = STATES_S if self._states_known else least_s
        return self._wants_joints and not self._states_heard and now_s - self._began_s >= wait_s

    def needs_messages(self, now_s: float) -> bool:
        """Whether messages of /tf need to be decoded."""
        if self._reads_base or self._watched:
            return True
        return self.reads_joints(now_s) and self.joints.wants_transforms

    def take_message(self, message: Any, static: bool, now_s: float) -> bool:
        """Take a TFMessage that arrived at `now_s` (seconds). Returns whether it had data of this robot.
        Raises RosMessageError when the message does not match its type."""
        transforms, left_out = read_transforms(message)
        self._merge.report_left_out(TOPIC, left_out)
        base = self.tree.take_transforms(transforms, static, now_s)
        if base is not None:
            self._merge.take_report(TOPIC, "base", TF, base, now_s)
        joints = self.joints.take_transforms(transforms, static, now_s) if self.reads_joints(now_s) else None
        if joints is not None:
            self._announce(now_s)
            self._merge.take_report(JOINTS_TOPIC, TF if static else "pos", TF, joints, now_s)
        return base is not None or joints is not None

    def check_time(self, now_s: float) -> None:
        """Log what is missing after a waiting time. Call it regularly."""
        self.tree.check_time(now_s)
        if self.reads_joints(now_s):
            self.joints.check_time(now_s)

    def explain_missing(self, now_s: float) -> None:
        """Log once what is missing for the base and the joints."""
        self.tree.explain_missing()
        if self.reads_joints(now_s):
            self.joints.explain_missing()

    def list_lines(self) -> list[str]:
        """Lines for `probe`: the frames, and the joints if they are read from /tf."""
        lines = self.tree.list_frames(self.joints.is_link)
        return [*lines, self.joints.describe()] if lines and not self._states_heard else lines

    def _announce(self, now_s: float) -> None:
        """Announce all joints of the model as channels from the start, in any order of transforms."""
        names = self.joints.names
        if names != self._names:
            self._names = names
            self._merge.forget_topic(JOINTS_TOPIC)
            self._merge.expect_topic(JOINTS_TOPIC)
            unknown = Report(None, {"pos": dict.fromkeys(names)}, lasts=True)
            self._merge.take_report(JOINTS_TOPIC, TF, TF, unknown, now_s)
