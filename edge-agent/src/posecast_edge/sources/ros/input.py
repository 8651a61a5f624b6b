"""Common part of both live ROS sources: takes discovered topics and their messages and makes samples.

Messages and samples belong to one thread; topics may be added by another.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from posecast_edge.kit import OnceLog, PartLog, kind_of
from posecast_edge.sample import Sample
from posecast_edge.sources.merge import STREAM_S
from posecast_edge.sources.ros.merge import MessageMerger
from posecast_edge.sources.ros.messages import (
    JOINT_STATE,
    STRING,
    TF,
    RosMessageError,
    get_text,
    read_message,
    validate_description,
)
from posecast_edge.sources.ros.robot_frames import STATES_S, RobotFrames
from posecast_edge.sources.ros.topics import STATIC, TOPIC_MAX, TYPES, Route, Routes

if TYPE_CHECKING:
    from posecast_edge.model.moving_joints import MovingJoint
    from posecast_edge.profile.types import Profile

log = logging.getLogger("posecast_edge.ros")

TOPICS_MAX = 2000  # remembered; further topics are neither shown nor read
UNREAD_S = 5.0  # from a topic of joint states with another name until it is named
NAMED_MAX = 8  # unsupported types that are logged; `probe` shows all


class RosInput:
    """The topics of one robot."""

    def __init__(self, name: str, profile: Profile | None, namespace: str = "") -> None:
        self.routes = Routes(profile.ros if profile else None, namespace)
        self.on_urdf: Callable[[str], None] | None = None
        self._name = name
        self._merge = MessageMerger(profile is not None, log.warning)
        self.frames = RobotFrames(
            profile, self._merge, lambda text: log.warning("%s: %s", name, text), namespace
        )
        self._topics: dict[tuple[str, str], Route | None] = {}
        self._messages: dict[str, int] = {}  # topic → count
        self._ignored = OnceLog(log.info, NAMED_MAX, "types")
        self._bad = PartLog(log.warning, "bad messages")
        self._urdf = ""
        self._reported_still = False
        self._unread_s: float | None = None  # when a topic of joint states with another name was found

    def add_topic(self, topic: str, type_name: str) -> Route | None:
        """Add a discovered topic and return how it is read, None if it is not read. `type_name`: short form.
        An unsupported type is logged once."""
        key = (topic, type_name)
        if key in self._topics:
            return self._topics[key]
        if len(self._topics) >= TOPICS_MAX or len(topic) > TOPIC_MAX or len(type_name) > TOPIC_MAX:
            return None
        route = self._topics[key] = self.routes.find_route(topic, type_name)
        if type_name == JOINT_STATE and route is None and self._unread_s is None:
            self._unread_s = time.monotonic()
        if route is not None and type_name not in (STRING, TF):
            self._merge.expect_topic(topic)
            if route.role == "pos":
                self.frames.expect_states()
        elif type_name not in TYPES:
            text = f"{self._name}: {topic} is ignored: the type {type_name} is not supported"
            self._ignored.add(text, type_name)
        return route

    def take_message(self, topic: str, type_name: str, decode: Callable[[], Any]) -> None:
        """Take one message. An invalid one is logged and ignored."""
        now_s = time.monotonic()
        route = self.add_topic(topic, type_name)
        if route is None:
            return
        self._messages[topic] = self._messages.get(topic, 0) + 1
        if route.role == "tf" and not self.frames.needs_messages(now_s):
            return
        try:
            message = decode()
            if route.role == "description":
                self.take_urdf(get_text(message))
                return
            if route.role == "tf":
                self.frames.take_message(message, route.site == STATIC, now_s)
                return
            field_name = "ref" if route.role == "ref" else "pos"
            report = read_message(type_name, message, route.site, field_name)
        except RosMessageError as e:
            self.report_bad(topic, str(e))
            return
        except Exception as e:  # one bad message must not affect anything else
            log.debug("message of %s", topic, exc_info=True)
            self.report_bad(topic, f"{type(e).__name__}: {str(e)[:200]}")
            return
        self.frames.note_report(route.role, report)
        self._merge.take_report(topic, route.role, type_name, report, now_s)

    def watch_frames(self) -> None:
        """Read /tf from now on, also its topics that were found before. May be called from any thread."""
        self.routes.watch_frames()
        for key in [key for key in self._topics.copy() if key[1] == TF]:
            self._topics[key] = self.routes.find_route(*key)

    def begin_reading_joints(self, listed: bool = False) -> bool:
        """Start reading /tf if no joint states arrive: at once if all topics are known (`listed`), otherwise
        after a while. Returns True when it starts now."""
        least_s = 0.0 if listed else STATES_S
        if self.routes.reads_frames or not self.frames.reads_joints(time.monotonic(), least_s):
            return False
        self.watch_frames()
        return True

    def report_bad(self, topic: str, text: str) -> None:
        """Log that a message is invalid: once for each topic and kind of problem, later ones as counts."""
        topic = topic[:TOPIC_MAX]
        self._bad.add(f"{topic}: {kind_of(text)}", f"{topic}: {text}")

    def make_sample(self) -> Sample | None:
        """The next sample to deliver, or None. Call it often."""
        now_s = time.monotonic()
        self.frames.check_time(now_s)
        sample = self._merge.make_sample(now_s)
        if self._unread_s is not None and now_s - self._unread_s > UNREAD_S:
            self._unread_s = math.inf  # once
            if text := self.routes.explain_unread(dict(self._topics.copy().keys())):
                log.warning("%s: %s", self._name, text)
        since_s = self._merge.stands_since_s
        if since_s is None:
            self._reported_still = False
        elif not self._reported_still and now_s - since_s > STREAM_S:
            self._reported_still = True
            log.warning("%s: messages arrive, but their timestamps do not change", self._name)
        return sample

    def list_topics(self) -> list[str]:
        """Lines for `probe`: every topic, its type, and how it is read; then the frames of /tf."""
        rows = []
        for (topic, type_name), route in sorted(self._topics.copy().items()):
            use = "not read" if route is None else f"→ {route.role}{f' {route.site}' if route.site else ''}"
            count = self._messages.get(topic, 0)
            messages = f"{count} message{'s' if count != 1 else ''}" if route else ""
            rows.append((topic, type_name, use, messages))
        widths = [max((len(row[i]) for row in rows), default=0) for i in range(3)] + [0]
        lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        return lines + self.frames.list_lines()

    def take_urdf(self, urdf: str) -> None:
        """Take the robot's description (URDF text). Raises RosMessageError when it is too long."""
        validate_description(urdf)
        if urdf == self._urdf or not urdf.strip():
            return
        self._urdf = urdf
        self.frames.joints.set_description(urdf)
        if self.on_urdf is not None:
            self.on_urdf(urdf)


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
