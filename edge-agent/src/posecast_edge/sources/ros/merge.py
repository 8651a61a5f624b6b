"""Messages of many topics and publishers → one robot's samples. Pure: time comes in as an argument.

What has been told stays until it is told anew or grows old: the arm's publisher does not wipe out the leg's.
A publisher that dies takes its readings with it after a while, so dead never looks like still. Where two
topics tell of one channel, the one whose name comes first in the alphabet counts (`/imu/data` before
`/imu/data_raw`), so that values never flap between the two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from posecast_edge.sample import Reading, Sample
from posecast_edge.sources.ros.messages import JOINT_STATE, Report

STREAM_S = 1.5  # a stream silent for so long has no readings any more; the page says STALE after as long
STATE_S = 60.0  # the same of what is told rarely or only when it changes
HOLD_S = 0.5  # a clock that went on so recently is not moved by another, nor back
SETTLE_S = 2.0  # without a profile the first sample says which channels there are: it waits for all of them
SETTLED_S = 0.5  # the same when everything that was expected has come
STRANDS_MAX = 256  # publishers told apart; the one silent for longest gives way
LABELS_MAX = 1 << 14  # of all publishers; the one silent for longest gives way (the wire has 4,096 channels)
DOUBLES_MAX = 8  # pairs of topics that are said to tell of one channel
TEXTS_MAX = 256  # about; further names are ignored
STREAMS = ("pos", "ref", "imu", "wrench", "base")


class RobotClock:
    """Robot time: the newest stamp of any message. A step back (a restarted simulation) counts
    once nobody has advanced the time for HOLD_S; without stamps, robot time is the time of arrival."""

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
            return False  # it stands still
        self.t_s = now_s if stamp_s is None else stamp_s
        self._stamped, self._moved_s = stamped, now_s
        return True


@dataclass
class _Strand:
    """What one publisher told last. `life_s`: how long that counts."""

    life_s: float
    heard_s: float
    values: Mapping[str, Mapping[str, Reading]] = field(default_factory=dict)


class MessageMerger:
    """Merges the messages of one robot. `settled`: its channels are known beforehand. `say` gets lines about
    channels that two topics report."""

    def __init__(self, settled: bool, say: Callable[[str], None]) -> None:
        self._say = say
        self._strands: dict[tuple[str, tuple[str, ...]], _Strand] = {}  # by topic and labels
        self._labels = 0  # of all strands
        self._clock = RobotClock()
        self._joints_s: float | None = None  # when positions last came
        self._began_s: float | None = None
        self._expected: dict[str, bool] = {}  # topic → heard
        self._settled = settled
        self._news = False
        self._info: dict[str, str] = {}
        self._links: dict[str, str] = {}
        self._doubled: set[tuple[str, str]] = set()
        self._anew = False
        self.stands_since_s: float | None = None  # positions come, but their time does not go on

    def expect_topic(self, topic: str) -> None:
        """Make the first sample wait for this topic, at most SETTLE_S seconds."""
        if len(self._expected) < STRANDS_MAX:
            self._expected.setdefault(topic, False)

    def take_report(self, topic: str, role: str, type_name: str, report: Report, now_s: float) -> None:
        """Take the content of one message. `role`: see topics.TYPES_OF_ROLE."""
        if topic in self._expected:
            self._expected[topic] = True
        key = (topic, tuple(label for readings in report.values.values() for label in readings))
        if key in self._strands:
            self._drop(key)
        else:
            self._look_for_doubles(topic, report.values)
        while self._strands and (
            len(self._strands) >= STRANDS_MAX or self._labels + len(key[1]) > LABELS_MAX
        ):
            self._drop(next(iter(self._strands)))
        self._labels += len(key[1])
        stream = role in STREAMS and not (role == "ref" and type_name == JOINT_STATE)
        # heard last stands last
        life_s = math.inf if report.lasts else STREAM_S if stream else STATE_S
        self._strands[key] = _Strand(life_s, now_s, report.values)
        for known, told in ((self._info, report.info), (self._links, report.links)):
            if len(known) < TEXTS_MAX:
                known.update(told)
            else:
                known.update((name, text) for name, text in told.items() if name in known)
        if not self._drives(role, now_s):
            return
        if self._clock.advance(report.stamp_s, now_s):
            self._news, self.stands_since_s = True, None
        elif self.stands_since_s is None:
            self.stands_since_s = now_s

    def forget_topic(self, topic: str) -> None:
        """Drop what was told of this topic: from now on another tells it."""
        for key in [key for key in self._strands if key[0] == topic]:
            self._drop(key)

    def announce_channels(self) -> None:
        """Mark the next sample as one that has channels which may come later than the first sample."""
        self._anew = True

    def make_sample(self, now_s: float) -> Sample | None:
        """All that is known, if something arrived since the last call and robot time has advanced; else
        None."""
        if not self._news or not self._ready(now_s):
            return None
        self._news = False
        old = [key for key, strand in self._strands.items() if now_s - strand.heard_s >= strand.life_s]
        for key in old:
            self._drop(key)
        values: dict[str, dict[str, Reading]] = {}
        for _, strand in sorted(self._strands.items(), key=lambda item: item[0][0], reverse=True):
            for name, readings in strand.values.items():
                values.setdefault(name, {}).update(readings)
        anew, self._anew = self._anew, False
        return Sample(self._clock.t_s, values, dict(self._info), links=dict(self._links), anew=anew)

    def _drop(self, key: tuple[str, tuple[str, ...]]) -> None:
        del self._strands[key]
        self._labels -= len(key[1])

    def _drives(self, role: str, now_s: float) -> bool:
        """Whether the message makes a sample: positions do, and other streams where there are none."""
        if role == "pos" or self._joints_s is None:
            self._joints_s = now_s  # who has not told positions yet is given time to
        return role == "pos" or (role in STREAMS and now_s - self._joints_s >= STREAM_S)

    def _ready(self, now_s: float) -> bool:
        if not self._settled:
            if self._began_s is None:
                self._began_s = now_s
            complete = bool(self._expected) and all(self._expected.values())
            self._settled = now_s - self._began_s >= (SETTLED_S if complete else SETTLE_S)
        return self._settled

    def _look_for_doubles(self, topic: str, values: Mapping[str, Mapping[str, Reading]]) -> None:
        for (other, _), strand in self._strands.items():
            pair = (min(topic, other), max(topic, other))
            if other == topic or pair in self._doubled or len(self._doubled) >= DOUBLES_MAX:
                continue
            for name, readings in values.items():
                both = readings.keys() & strand.values.get(name, {}).keys()
                if both:
                    self._doubled.add(pair)
                    more = "; further ones are not said" if len(self._doubled) == DOUBLES_MAX else ""
                    self._say(
                        f"{name} of {min(both)!r} is told by {pair[0]} and {pair[1]}: the first counts; "
                        f"a profile's [ros] can say which{more}"
                    )
                    break
