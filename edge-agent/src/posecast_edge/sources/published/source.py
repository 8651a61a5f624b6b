"""The source behind `posecast.Robot`: takes what the program has published whenever a frame is due."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterable, Mapping, Sequence

from posecast_wire.schema import Schema, SchemaError

from posecast_edge import clock
from posecast_edge.profile.field_defaults import WELL_KNOWN
from posecast_edge.profile.schema import infer_profile, make_schema_text
from posecast_edge.profile.types import Profile
from posecast_edge.sample import Reading, Sample, SourceError
from posecast_edge.sources.base import Deliver
from posecast_edge.sources.published.problems import ProblemList
from posecast_edge.sources.published.slot import FLAGS, PublishedSlot, Readings, Taken
from posecast_edge.visible import quote

LOOK_S = 0.2  # the longest sleep: the end is noticed this soon
SETTLE_S = 0.5  # without a profile the first sample says what there is: it waits for all that is published
LATE = f"it came over {SETTLE_S} s after the first call; publish it from the start, or give profile=…"
JOINT_FIELDS = frozenset(name for name, known in WELL_KNOWN.items() if known.joints)

Labels = Mapping[str, frozenset[str]]  # of each field


class PublishedSource:
    """`joints`: the robot's joints in order, empty when nobody said. The agent calls `run`; `end` and
    `check_model` may be called from any thread."""

    description = "Python"

    def __init__(
        self,
        robot: str,
        slot: PublishedSlot,
        joints: Sequence[str],
        profile: Profile | None,
        problems: ProblemList,
    ) -> None:
        self._robot, self._slot, self._joints, self._problems = robot, slot, tuple(joints), problems
        self._profile_given = profile is not None
        self._known: Labels | None = _labels_by_field(profile) if profile else None
        self._model_joints: frozenset[str] | None = None
        self._ended = False

    def end(self) -> None:
        """Make `run` deliver what waits and return. Takes no lock, so the garbage collector may call it."""
        self._ended = True

    def check_model(self, joints: Iterable[str]) -> None:
        """Report the published joints that are none of these, which are the model's."""
        self._model_joints = frozenset(joints)
        if self._known is not None:
            self._compare_with_model(self._known)

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver the newest readings as often as frames are sent, until `end` or `stop`."""
        first_s: float | None = None
        while not stop.is_set():
            ended = self._ended  # before the last look
            if not ended:
                self._slot.wait(LOOK_S)
            if self._known is None and not ended and self._slot.published:
                first_s = time.monotonic() if first_s is None else first_s
                self._sleep(first_s + SETTLE_S, stop)
            taken = self._slot.take(clock.now_s())
            wanted_s = self._deliver(taken, deliver) if taken else None
            self._problems.log_new()
            if ended:
                return
            if wanted_s is not None:
                self._sleep(wanted_s, stop)

    def _sleep(self, until_s: float, stop: threading.Event) -> None:
        """Until this monotonic time, or the end."""
        while not self._ended and (rest_s := until_s - time.monotonic()) > 0:
            if stop.wait(min(rest_s, LOOK_S)):
                return

    def _deliver(self, taken: Taken, deliver: Deliver) -> float | None:
        values = {name: readings for name, readings in taken.values.items() if readings}
        if self._known is None:
            self._known = self._learn(self._order(values))
        known = self._known
        if known is None:
            return None
        if not self._profile_given:
            values = self._order(values)  # the agent, too, learns from the first
        checked = self._check(values, known)
        for t_s, flags in taken.flags:  # with all the rest: one of them may be the first
            deliver(Sample(t_s, {**checked, **self._check({FLAGS: flags}, known)}, taken.info, newest=False))
        return deliver(Sample(taken.t_s, checked, taken.info))

    def _order(self, values: Mapping[str, Readings]) -> dict[str, Readings]:
        """Joints as joints=[…] has them, also those that are not published yet."""
        values = {"pos": {}, **values} if self._joints else values
        return {
            name: {**dict.fromkeys(self._joints), **readings} if name in JOINT_FIELDS else readings
            for name, readings in values.items()
        }

    def _learn(self, values: Mapping[str, Readings]) -> Labels | None:
        """What the agent will take the robot to have, from its first sample; None when that is not enough."""
        if self._joints:
            own = frozenset(self._joints)
            values = {
                name: {k: v for k, v in readings.items() if k in own} if name in JOINT_FIELDS else readings
                for name, readings in values.items()
            }
        profile = self._infer(values)
        if profile is None:  # not for the sake of one field
            values = {name: readings for name, readings in values.items() if self._infer({name: readings})}
            profile = self._infer(values) if values else None
        if profile is None:
            return None
        known = _labels_by_field(profile)
        self._compare_with_model(known)
        return known

    def _infer(self, values: Mapping[str, Readings]) -> Profile | None:
        try:
            profile = infer_profile(self._robot, Sample(0.0, values))
            Schema.parse(make_schema_text(profile))
        except (SourceError, SchemaError) as e:
            self._problems.add(f"{', '.join(values)[:100]}: {e}")
            return None
        return profile

    def _check(self, values: Mapping[str, Readings], known: Labels) -> dict[str, Readings]:
        checked: dict[str, Readings] = {}
        for name, readings in values.items():
            labels = known.get(name)
            if labels is None:
                self._problems.add(f"{name} is left out: {self._why_unknown(name)}")
                continue
            checked[name] = {}
            for label, reading in readings.items():
                if label in labels:
                    checked[name][label] = self._check_reading(name, label, reading)
                else:
                    self._problems.add(f"{name} of {quote(label)} is left out: {self._why_unknown(name)}")
        return checked

    def _check_reading(self, name: str, label: str, reading: Reading) -> Reading:
        if type(reading) is float and not math.isfinite(reading):
            self._problems.add(f"{name} of {quote(label)} is {reading}, which is no reading")
            return None
        return reading

    def _why_unknown(self, name: str) -> str:
        if self._profile_given:
            return "the profile has none of that name"
        return "it is none of joints=[…]" if self._joints and name in JOINT_FIELDS else LATE

    def _compare_with_model(self, known: Labels) -> None:
        if self._profile_given or self._model_joints is None:  # a profile says itself what moves what
            return
        for name in sorted(JOINT_FIELDS & known.keys()):
            for label in sorted(known[name] - self._model_joints):
                self._problems.add(f"{name} of {quote(label)} moves nothing: the model has no such joint")


def _labels_by_field(profile: Profile) -> Labels:
    return {f.name: frozenset(f.labels) for f in profile.fields}
