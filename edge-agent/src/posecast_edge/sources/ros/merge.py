"""Merges messages of many topics and publishers into one robot's samples. Pure: time is an argument.

If two topics report the same channel, the first in alphabetical order is used (`/imu/data` before
`/imu/data_raw`), so that values never alternate between the two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from posecast_edge.kit import OnceLog
from posecast_edge.sample import Reading, Sample
from posecast_edge.sources.merge import STATE_S, STREAM_S, LatestReadings
from posecast_edge.sources.ros.messages import JOINT_STATE, Report

HOLD_S = 0.5  # a clock that advanced this recently is not set by another clock, nor set back
SETTLE_S = 2.0  # without a profile, each later channel gives viewers a new schema: wait for all of them
SETTLED_S = 0.5  # how long to wait once everything expected has arrived
PUBLISHERS_MAX = 256  # combinations of a topic and its labels
DOUBLES_MAX = 8  # pairs of topics with the same channel that are logged
LEFT_OUT_MAX = 50  # parts of messages that are logged
TEXTS_MAX = 256  # about; further names are ignored
STREAMS = ("pos", "ref", "imu", "wrench", "base")

Values = Mapping[str, Mapping[str, Reading]]  # of one message: field → label → reading


class RobotClock:
    """Robot time: the newest timestamp of any message. A step back (a restarted simulation) is accepted once
    the time has not advanced for HOLD_S. Without timestamps, robot time is the time of arrival."""

    def __init__(self) -> None:
        self.t_s = 0.0
        self._stamped = False
        self._moved_s: float | None = None

    def advance(self, stamp_s: float | None, now_s: float) -> bool:
        """Take the stamp of a message that arrived at monotonic `now_s`. Returns whether robot time has
        advanced."""
        stamped = stamp_s is not None
        if self._moved_s is not None and now_s - self._moved_s < HOLD_S:
            if stamped != self._stamped or (stamp_s is not None and stamp_s <= self.t_s):
                return False
        elif stamp_s is not None and stamp_s == self.t_s:
            return False  # it does not advance
        self.t_s = now_s if stamp_s is None else stamp_s
        self._stamped, self._moved_s = stamped, now_s
        return True


class MessageMerger:
    """Merges the messages of one robot. `settled`: its channels are known in advance. `say` is called with
    lines about channels that two topics report, and about parts of messages that are left out."""

    def __init__(self, settled: bool, say: Callable[[str], None]) -> None:
        self._last = LatestReadings[Values](PUBLISHERS_MAX)  # by topic
        self._clock = RobotClock()
        self._joints_s: float | None = None  # when positions last arrived
        self._began_s: float | None = None
        self._expected: dict[str, bool] = {}  # topic → heard
        self._settled = settled
        self._news = False
        self._info: dict[str, str] = {}
        self._links: dict[str, str] = {}
        self._doubled = OnceLog(say, DOUBLES_MAX)
        self._left_out = OnceLog(say, LEFT_OUT_MAX, "parts")
        self.stands_since_s: float | None = None  # positions arrive, but their timestamps do not advance

    def expect_topic(self, topic: str) -> None:
        """Make the first sample wait for this topic, at most SETTLE_S seconds."""
        if len(self._expected) < PUBLISHERS_MAX:
            self._expected.setdefault(topic, False)

    def take_report(self, topic: str, role: str, type_name: str, report: Report, now_s: float) -> None:
        """Take the content of one message. `role`: see topics.TYPES_OF_ROLE."""
        if topic in self._expected:
            self._expected[topic] = True
        self.report_left_out(topic, report.left_out)
        for part, how in report.remarks.items():
            self._left_out.add(f"{topic}: {how}", f"{topic} {part}")
        labels = tuple(label for readings in report.values.values() for label in readings)
        stream = role in STREAMS and not (role == "ref" and type_name == JOINT_STATE)
        life_s = math.inf if report.lasts else STREAM_S if stream else STATE_S
        if self._last.replace(topic, labels, report.values, life_s, now_s) is None:
            self._look_for_doubles(topic, report.values)
        for known, reported in ((self._info, report.info), (self._links, report.links)):
            if len(known) < TEXTS_MAX:
                known.update(reported)
            else:
                known.update((name, text) for name, text in reported.items() if name in known)
        if not self._drives(role, now_s):
            return
        if self._clock.advance(report.stamp_s, now_s):
            self._news, self.stands_since_s = True, None
        elif self.stands_since_s is None:
            self.stands_since_s = now_s

    def forget_topic(self, topic: str) -> None:
        """Drop the readings of this topic, because another topic reports them from now on."""
        self._last.forget(topic)

    def report_left_out(self, topic: str, left_out: Mapping[str, str]) -> None:
        """Report each part of a topic's messages that is left out once (see messages.Report)."""
        for part, why in left_out.items():
            self._left_out.add(f"{topic}: {why}; it is left out", f"{topic} {part}")

    def make_sample(self, now_s: float) -> Sample | None:
        """All valid readings, if something arrived since the last call and robot time has advanced; otherwise
        None."""
        if not self._news or not self._ready(now_s):
            return None
        self._news = False
        values: dict[str, dict[str, Reading]] = {}
        for _, _, own in sorted(self._last.list_valid(now_s), key=lambda last: last[0], reverse=True):
            for name, readings in own.items():
                values.setdefault(name, {}).update(readings)
        return Sample(self._clock.t_s, values, dict(self._info), links=dict(self._links))

    def _drives(self, role: str, now_s: float) -> bool:
        """Whether the message causes a sample: positions do; other streams do if there are no positions."""
        if role == "pos" or self._joints_s is None:
            self._joints_s = now_s  # give positions time to arrive
        return role == "pos" or (role in STREAMS and now_s - self._joints_s >= STREAM_S)

    def _ready(self, now_s: float) -> bool:
        if not self._settled:
            if self._began_s is None:
                self._began_s = now_s
            complete = bool(self._expected) and all(self._expected.values())
            self._settled = now_s - self._began_s >= (SETTLED_S if complete else SETTLE_S)
        return self._settled

    def _look_for_doubles(self, topic: str, values: Values) -> None:
        for other, _, own in self._last.list_all():
            first, second = sorted((topic, other))
            if other == topic or self._doubled.has_logged(f"{first} {second}"):
                continue
            for name, readings in values.items():
                both = readings.keys() & own.get(name, {}).keys()
                if both:
                    text = f"{name} of {min(both)!r} is on {first} and {second}: the first is used"
                    advice = "to choose another, set it in a profile's [ros]"
                    self._doubled.add(f"{text}; {advice}", f"{first} {second}")
                    break
