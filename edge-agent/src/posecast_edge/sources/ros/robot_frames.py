"""Reads a robot's base pose from /tf and /tf_static, and its joints if there are no joint states. Live
sources and recordings both use it."""

from __future__ import annotations

import io
import math
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from posecast_edge.kit import OnceLog, make_visible, quote
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.moving_joints import MovingJoint, list_moving_joints
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.sample import Reading
from posecast_edge.sources.ros.merge import MessageMerger
from posecast_edge.sources.ros.messages import TF, Report, Transform, read_transforms
from posecast_edge.sources.ros.transforms import (
    FRAMES_MAX,
    SHOWN,
    WAIT_S,
    Pose,
    TransformTree,
    invert_pose,
    multiply_poses,
)

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
        self, profile: Profile | None, merge: MessageMerger, say: Callable[[str], None], namespace: str = ""
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


# --- joints

OFF_M, OFF_RAD = 0.005, math.radians(2)  # a calibrated robot deviates less from its model
NO_MODEL = (
    "no joint states; to compute the joints from /tf, give the robot's model: --urdf FILE or --model FOLDER"
)


class JointFrames:
    """Computes the joint values of one robot from the transforms between links, for a robot without joint
    states. Pure: time is an argument.

    robot_state_publisher publishes, for each joint, the pose of its child link in its parent link. With the
    model, this gives the joint's value. A common prefix of a robot's frames (`r1/base_link`) is detected.

    `namespace`: of the robot, "" without one; decides between several prefixes that
    fit. `channels`: joints with other names are left out; None: none is left out. `say` is called with a line
    for each problem.
    """

    def __init__(
        self, say: Callable[[str], None], namespace: str = "", channels: Collection[str] | None = None
    ) -> None:
        self._channels = channels
        self._wanted = f"{namespace.strip('/')}/"
        self._joints: tuple[MovingJoint, ...] = ()
        self._given: Sequence[MovingJoint] | None = (
            None  # from the user; preferred to the robot's description
        )
        self._has_model = False
        self._is_given = False
        self._description: str | None = None  # not parsed yet
        self._parents: dict[str, str] = {}  # frame → parent
        self._prefixes: dict[str, list[str]] = {}  # frame → the prefixes with which it is a link of the model
        self._votes: Counter[str] = Counter()
        self._prefix: str | None = None  # None until a frame fits
        self._by_child: dict[str, MovingJoint] = {}  # by link
        self._by_frame: dict[str, MovingJoint] = {}  # by the prefix and the link
        self._found: set[str] = set()  # joints that have had a value
        self._misfits: set[str] = set()
        self._began_s: float | None = None
        self._once = OnceLog(say)

    @property
    def names(self) -> list[str]:
        """The names of the model's joints that have their own value, in the model's order."""
        return [joint.name for joint in self._joints]

    @property
    def wants_transforms(self) -> bool:
        """Whether transforms are needed. False while there is no model and that has been logged."""
        if self._given is not None or (self._description is not None and not self._is_given):
            return True
        return bool(self._joints) if self._has_model else not self._once.has_logged(NO_MODEL)

    def set_joints(self, joints: Sequence[MovingJoint]) -> None:
        """Take the joints of the shown model. May be called from any thread."""
        self._given = tuple(joints)

    def set_description(self, urdf: str) -> None:
        """Take the robot's own description (URDF text), used if no joints were given. It is parsed when it is
        needed."""
        self._description = urdf

    def is_link(self, frame: str) -> bool:
        """Whether the frame is a link that a joint of the model moves."""
        return frame in self._by_frame

    def take_transforms(self, transforms: Sequence[Transform], static: bool, now_s: float) -> Report | None:
        """Take transforms that arrived at `now_s` (seconds). Returns the values of their joints, None if they
        have none. A joint whose transform does not fit has no reading."""
        if self._began_s is None:
            self._began_s = now_s
        self._adopt_model()
        news = [one for one in transforms if self._parents.get(one.child) != one.parent]
        for one in news:
            self._meet_frame(one)
        if news:
            self._choose_prefix()
        if self._prefix is None:
            return None
        readings: dict[str, Reading] = {}
        stamp_s: float | None = None
        for one in transforms:
            joint = self._by_frame.get(one.child)
            if joint is not None and one.parent == self._prefix + joint.parent:
                readings[joint.name] = self._read_joint(joint, one)
                stamp_s = one.stamp_s if stamp_s is None else max(stamp_s, one.stamp_s or stamp_s)
        return Report(stamp_s, {"pos": readings}, lasts=static) if readings else None

    def check_time(self, now_s: float) -> None:
        """Log what is missing after a waiting time. Call it regularly."""
        if self._began_s is not None and now_s - self._began_s >= WAIT_S:
            self.explain_missing()

    def explain_missing(self) -> None:
        """Log once which joints have no value, if there are any."""
        if self._began_s is None:  # no transform arrived
            return
        if not self._has_model:
            self._once.add(NO_MODEL, NO_MODEL)
        elif self._misfits or len(self._found) < len(self._joints):
            self._once.add(self.describe())

    def describe(self) -> str:
        """One line for `probe`: how many of the model's joints have had a value, and why the others have
        not."""
        if not self._has_model:
            return f"joints from /tf: none; {NO_MODEL}"
        parts = [f"joints from /tf: {len(self._found)} of {len(self._joints)}"]
        off = [joint.name for joint in self._joints if joint.name in self._misfits]
        silent = [j for j in self._joints if j.name not in self._found and j.name not in self._misfits]
        if off:
            parts.append(f"off their axis: {_list(off)}")
        if silent:
            missing = [f"{joint.name} ({joint.parent} → {joint.child})" for joint in silent[: SHOWN + 1]]
            parts.append(f"no transform for {_list(missing)}")
        if self._joints and not self._found:
            parts.append("is this the robot's model?")
        return make_visible("; ".join(parts))

    # --- the model

    def _adopt_model(self) -> None:
        if self._given is not None:
            joints, self._given, self._is_given = tuple(self._given), None, True
        elif self._description is not None and not self._is_given:
            urdf, self._description = self._description, None
            try:
                joints = list_moving_joints(read_urdf(io.BytesIO(urdf.encode())))
            except (ModelRefused, UnicodeEncodeError):  # the model's builder reports the reason
                return
        else:
            return
        self._joints = tuple(
            replace(joint, parent=joint.parent.strip("/"), child=joint.child.strip("/"))
            for joint in joints
            if self._channels is None or joint.name in self._channels
        )
        if joints and not self._joints:
            self._once.add("joints are not read from /tf: the profile's pos has none of the model's joints")
        self._has_model = True
        self._by_child = {joint.child: joint for joint in self._joints}
        for known in (self._found, self._misfits, self._votes, self._prefixes, self._by_frame):
            known.clear()
        self._prefix = None
        for child, parent in self._parents.items():
            self._vote(child, parent)
        self._choose_prefix()

    # --- which frame is which link

    def _meet_frame(self, transform: Transform) -> None:
        """Take a frame that is new or has another parent than before."""
        if transform.child not in self._parents and len(self._parents) >= FRAMES_MAX:
            return
        self._parents[transform.child] = transform.parent
        self._vote(transform.child, transform.parent)

    def _vote(self, child: str, parent: str) -> None:
        for prefix in self._prefixes.pop(child, ()):
            self._votes[prefix] -= 1
        fits = []
        for start in range(len(child)):
            joint = self._by_child.get(child[start:])
            if joint is not None and parent == child[:start] + joint.parent:
                fits.append(child[:start])
                self._votes[child[:start]] += 1
        if fits:
            self._prefixes[child] = fits

    def _choose_prefix(self) -> None:
        """Choose the prefix with which most frames are links of the model. Keep it until another has more."""
        fits = {prefix: count for prefix, count in self._votes.items() if count}
        if not fits:
            return
        best = self._wanted if self._wanted in fits else max(fits, key=fits.__getitem__)
        now = self._prefix
        if now is None or (best != now and (best == self._wanted or fits[best] > fits.get(now, 0))):
            self._prefix = now = best
            self._by_frame = {best + joint.child: joint for joint in self._joints}
        others = [prefix for prefix, count in fits.items() if prefix != now and count == fits.get(now) != 1]
        if others and now != self._wanted:
            shown = _list([quote(prefix) for prefix in (now, *others)])
            text = f"/tf has the frames of several robots, with the prefixes {shown}: the first is read"
            self._once.add(text)

    # --- one joint

    def _read_joint(self, joint: MovingJoint, transform: Transform) -> Reading:
        found = compute_joint_value(joint, (transform.xyz, transform.wxyz))
        if found.off_m <= OFF_M and found.off_rad <= OFF_RAD:
            self._found.add(joint.name)
            self._misfits.discard(joint.name)
            return found.value
        self._misfits.add(joint.name)
        self._found.discard(joint.name)
        self._once.add(
            f"{joint.name} is not read from /tf: {transform.parent} → {transform.child} is "
            f"{math.degrees(found.off_rad):.1f}° and {found.off_m * 1e3:.0f} mm off its axis; "
            "is this the robot's model?",
            "misfit",
        )
        return None


def _list(names: Sequence[str]) -> str:
    return ", ".join(names[:SHOWN]) + (", …" if len(names) > SHOWN else "")


# --- the value of a joint, from the pose of its child link in its parent link

TURN = 2 * math.pi
SLACK = 1e-3  # rad: a joint may be this far beyond its limit before a full turn is added


class JointValue(NamedTuple):
    """`value`: rad, or m for a joint that slides. `off_m`, `off_rad`: the part of the transform that the
    joint can't produce."""

    value: float
    off_m: float
    off_rad: float


def compute_joint_value(joint: MovingJoint, parent_from_child: Pose) -> JointValue:
    """The value at which the child link has this pose. An angle is in -π … π, or one turn away if only that
    is within the joint's limits. `parent_from_child`: metres, unit quaternion w x y z."""
    (x, y, z), (w, qx, qy, qz) = multiply_poses(invert_pose((joint.xyz, joint.quat)), parent_from_child)
    a, b, c = joint.axis
    if joint.slides:
        value = x * a + y * b + z * c
        off_m = math.hypot(x - value * a, y - value * b, z - value * c)
        return JointValue(value, off_m, 2 * math.atan2(math.hypot(qx, qy, qz), abs(w)))
    along = qx * a + qy * b + qz * c
    across = math.hypot(qx - along * a, qy - along * b, qz - along * c)
    angle = math.remainder(2 * math.atan2(along, w), TURN)
    off_rad = 2 * math.atan2(across, math.hypot(w, along))
    return JointValue(_turn_into_limits(angle, joint), math.hypot(x, y, z), off_rad)


def _turn_into_limits(angle: float, joint: MovingJoint) -> float:
    low = -math.inf if joint.lower is None else joint.lower - SLACK
    high = math.inf if joint.upper is None else joint.upper + SLACK
    within = (turned for turned in (angle, angle + TURN, angle - TURN) if low <= turned <= high)
    return next(within, angle)
