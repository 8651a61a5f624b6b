"""Merges messages of many topics and publishers into one robot's samples. Pure: time is an argument.

If two topics report the same channel, the first in alphabetical order is used (`/imu/data` before
`/imu/data_raw`), so that values never alternate between the two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from posecast_edge.kit import OnceLog, quote
from posecast_edge.sample import Reading, Sample
from posecast_edge.sources.merge import STATE_S, STREAM_S, LatestReadings
from posecast_edge.sources.ros.messages import JOINT_STATE, Report

HOLD_S = 0.5  # a clock that advanced this recently is not set by another publisher
SAME_CLOCK_S = 2.0  # publishers whose timestamps differ by more have different clocks
SAY_APART_S = 10.0  # clocks that differ by more are logged
STEP_S, PACE_MOST = 2.0, 20.0  # a clock steps on by no more at once, or so many times faster than real time
COUNT_TO_LEAD = 3  # messages
GAPS_MOST = 2.5  # a leader that is silent for so many times its last interval is gone
TURNS_TO_SAY = 5  # of the leader: before that, it may lose the lead
CLOCKS_MAX = 8  # pairs of publishers with different clocks that are logged
CONTINUES, STANDS, SET, STRAY = "continues", "stands", "set", "stray"
SETTLE_S = 2.0  # without a profile, each later channel gives viewers a new schema: wait for all of them
SETTLED_S = 0.5  # how long to wait once everything expected has arrived
PUBLISHERS_MAX = 256  # combinations of a topic and its labels
DOUBLES_MAX = 8  # pairs of topics with the same channel that are logged
LEFT_OUT_MAX = 50  # parts of messages that are logged
TEXTS_MAX = 256  # about; further names are ignored
STREAMS = ("pos", "ref", "imu", "wrench", "base")

Publisher = tuple[str, str, int]  # topic, first label, number of labels: several may share a topic
Values = Mapping[str, Mapping[str, Reading]]  # of one message: field → label → reading


@dataclass
class _Stamps:
    """The timestamps of one publisher. `last_s`: the newest that continues the others; `came_s`: when it
    arrived, `gap_s` after the one before; `jump_s`: one that does not continue them, until the next shows
    whether it was a stray. `turn`, `count`: how often it was heard since the leader's last; `faster`: in how
    many turns in a row that was often; `strange`: in how many its clock was another."""

    publisher: Publisher
    is_stamped: bool = False
    last_s: float | None = None
    came_s: float = 0.0
    gap_s: float = 0.0
    jump_s: float | None = None
    turn: int = 0
    count: int = 0
    faster: int = 0
    strange: int = 0

    def take(self, stamp_s: float, now_s: float) -> str:
        """Take the next one: does it CONTINUE the others, STAND still, or is it the second one of a clock
        that has been SET? A first one may be a STRAY."""
        last_s, jump_s, self.jump_s = self.last_s, self.jump_s, None
        most_s = max(STEP_S, PACE_MOST * (now_s - self.came_s))
        if last_s is None or 0 < stamp_s - last_s <= most_s:
            found = CONTINUES
        elif stamp_s == last_s:
            return STANDS
        elif jump_s is not None and 0 < stamp_s - jump_s <= most_s:
            found = SET
        else:
            self.jump_s = stamp_s
            return STRAY
        self.gap_s = 0.0 if last_s is None else now_s - self.came_s
        self.last_s, self.came_s = stamp_s, now_s
        return found


class RobotClock:
    """Robot time: the newest timestamp of the publisher that leads, and of those with the same clock. If a
    publisher has another clock (simulated time beside wall time), its readings count, but not its timestamps.
    It takes the lead once the leader is silent or clearly slower.

    A clock that is set, such as that of a restarted simulation or of a recording in a loop, is followed from
    its second message on. So a stray timestamp does not count, unless the robot is heard less than twice a
    second. Without timestamps, robot time is the time of arrival. `say` is called with a line about two
    clocks.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self.t_s = 0.0
        self.stands = False  # the newest message had the same time as its publisher's last
        self._publishers: dict[Publisher, _Stamps] = {}
        self._leader: _Stamps | None = None
        self._turn = 0  # counts the messages of leaders
        self._led_s = self._moved_s = self._set_s = -math.inf
        self._two = OnceLog(say, CLOCKS_MAX, "clocks")

    def advance(self, publisher: Publisher, stamp_s: float | None, now_s: float) -> bool:
        """Take the stamp of a message that arrived at monotonic `now_s`. Returns whether robot time has
        advanced."""
        one = self._find(publisher)
        held = now_s - self._moved_s < HOLD_S
        self.stands = False
        if stamp_s is None and one.is_stamped and held:
            return False
        if one.is_stamped != (stamp_s is not None):
            one.is_stamped, one.last_s = stamp_s is not None, None
        stamp_s = now_s if stamp_s is None else stamp_s
        found = one.take(stamp_s, now_s)
        self.stands = found == STANDS
        if self._leader is None or self._leader is one:
            return self._follow(one, stamp_s, now_s, found)
        return self._go_with(one, stamp_s, now_s, found)

    def _find(self, publisher: Publisher) -> _Stamps:
        one = self._publishers.get(publisher)
        if one is None:
            if len(self._publishers) >= PUBLISHERS_MAX:
                oldest = next(key for key, other in self._publishers.items() if other is not self._leader)
                del self._publishers[oldest]
            one = self._publishers[publisher] = _Stamps(publisher)
        return one

    def _follow(self, one: _Stamps, stamp_s: float, now_s: float, found: str) -> bool:
        held = now_s - self._moved_s < HOLD_S
        if found == STANDS or (held and found == STRAY):
            return False
        self._leader, self._led_s = one, now_s
        self._turn += 1
        if found == STRAY:
            one.last_s, one.came_s, one.jump_s = stamp_s, now_s, None
        if held and found == CONTINUES and stamp_s <= self.t_s:
            return False  # another publisher with this clock is ahead
        if found != CONTINUES:
            self._set_s = now_s
        self.t_s, self._moved_s = stamp_s, now_s
        return True

    def _go_with(self, one: _Stamps, stamp_s: float, now_s: float, found: str) -> bool:
        """Take the stamp of a publisher that does not lead."""
        assert self._leader is not None
        if one.turn != self._turn:
            often = one.turn == self._turn - 1 and one.count >= COUNT_TO_LEAD
            one.turn, one.count, one.faster = self._turn, 0, one.faster + 1 if often else 0
            one.strange += 1
        one.count += 1
        apart_s = stamp_s - (self.t_s + now_s - self._moved_s)
        if abs(apart_s) <= SAME_CLOCK_S:
            one.strange = 0
            if found != CONTINUES or stamp_s <= self.t_s or now_s - self._set_s < HOLD_S:
                return False
            self.t_s, self._moved_s = stamp_s, now_s
            return True
        silent_s, leader = now_s - self._led_s, self._leader
        dead = silent_s >= max(STREAM_S, GAPS_MOST * leader.gap_s)
        dead |= silent_s >= HOLD_S and one.count >= COUNT_TO_LEAD
        if (dead or one.faster >= COUNT_TO_LEAD) and found == CONTINUES:
            self._say_two(leader, one, -apart_s)
            self._leader, one.strange, one.faster = None, 0, 0
            self._set_s = now_s
            self.t_s = -math.inf
            return self._follow(one, stamp_s, now_s, found)
        if one.strange == TURNS_TO_SAY:
            self._say_two(one, leader, apart_s)
        return False

    def _say_two(self, one: _Stamps, leader: _Stamps, apart_s: float) -> None:
        if not (one.is_stamped and leader.is_stamped and abs(apart_s) > SAY_APART_S):
            return
        other, used = (f"{topic} ({quote(label)})" for topic, label, _ in (one.publisher, leader.publisher))
        text = (
            f"two clocks: the timestamps of {other} are {abs(apart_s):.0f} s "
            f"{'ahead of' if apart_s > 0 else 'behind'} those of {used}, which are used; "
            "is use_sim_time the same for both?"
        )
        self._two.add(text, " ".join(sorted((other, used))))


class MessageMerger:
    """Merges the messages of one robot. `settled`: its channels are known in advance. `say` is called with
    lines about channels that two topics report, about two clocks, and about parts of messages that are left
    out."""

    def __init__(self, settled: bool, say: Callable[[str], None]) -> None:
        self._last = LatestReadings[Values](PUBLISHERS_MAX)  # by topic
        self._clock = RobotClock(say)
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
        publisher = (topic, labels[0] if labels else "", len(labels))
        if self._clock.advance(publisher, report.stamp_s, now_s):
            self._news, self.stands_since_s = True, None
        elif self.stands_since_s is None and self._clock.stands:
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
