"""The source behind `posecast.Robot`: takes the published readings whenever a frame is due."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping, Sequence

from posecast_edge import clock
from posecast_edge.model.serve.bundle import Bundle
from posecast_edge.profile.types import Profile
from posecast_edge.sample import Reading, Sample
from posecast_edge.sources.base import Deliver
from posecast_edge.sources.published.channels import JOINT_FIELDS, OF_PROFILE, Labels, PublishedChannels
from posecast_edge.sources.published.clock_check import ClockCheck
from posecast_edge.sources.published.model_check import ModelCheck
from posecast_edge.sources.published.problems import ProblemList
from posecast_edge.sources.published.slot import FLAGS, PublishedSlot, Readings, Taken
from posecast_edge.visible import quote

LOOK_S = 0.2  # the longest sleep; the end is noticed within it
SETTLE_S = 0.5  # without a profile, the first sample defines the channels: wait for all readings


class PublishedSource:
    """`joints`: the robot's joints in order, empty if not given. The agent calls `run`; `end` and
    `expect_model` may be called from any thread."""

    description = "Python"

    def __init__(
        self,
        robot: str,
        slot: PublishedSlot,
        joints: Sequence[str],
        profile: Profile | None,
        problems: ProblemList,
    ) -> None:
        self._slot, self._joints, self._problems = slot, tuple(joints), problems
        self._profile_given = profile is not None
        self._channels = PublishedChannels(robot, joints, profile, problems)
        self._model, self._clock = ModelCheck(problems), ClockCheck(problems)
        self._is_compared = True  # whether joint names have been compared with the model's
        self._ended = False

    def end(self) -> None:
        """Make `run` deliver waiting readings and return. Takes no lock, so the garbage collector may call
        it."""
        self._ended = True

    def expect_model(self, bundle: Bundle) -> None:
        """Report errors of the robot's model and, from now on, published values that do not fit it."""
        self._model.take_model(bundle)
        self._is_compared = False

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver the newest readings as often as frames are sent, until `end` or `stop`."""
        first_s: float | None = None
        while not stop.is_set():
            ended = self._ended  # read it before the last take
            if not ended:
                self._slot.wait(LOOK_S)
            if self._channels.labels is None and not ended and self._slot.published:
                first_s = time.monotonic() if first_s is None else first_s
                self._sleep(first_s + SETTLE_S, stop)
            taken = self._slot.take(clock.now_s())
            if taken:
                self._clock.check_time(taken.t_s, time.monotonic())
            wanted_s = self._deliver(taken, deliver) if taken else None
            self._problems.log_new()
            if ended:
                return
            if wanted_s is not None:
                self._sleep(wanted_s, stop)

    def _sleep(self, until_s: float, stop: threading.Event) -> None:
        """Sleep until this monotonic time, or the end."""
        while not self._ended and (rest_s := until_s - time.monotonic()) > 0:
            if stop.wait(min(rest_s, LOOK_S)):
                return

    def _deliver(self, taken: Taken, deliver: Deliver) -> float | None:
        values = {name: readings for name, readings in taken.values.items() if readings}
        if not self._profile_given:
            values = self._order(values)  # the agent, too, infers its profile from the first sample
        before = self._channels.labels
        if before is None:
            self._channels.learn(values)
        anew = self._channels.grow(values, time.monotonic())
        known = self._channels.labels
        if known is None:
            return None
        if known is not before or not self._is_compared:
            self._is_compared = True
            self._compare_names(known)
        checked = self._check(values, known)
        if not self._profile_given:
            self._model.check_positions(checked)
        for t_s, flags in taken.flags:  # with all other readings: one of them may be the first sample
            replaced = {**checked, **self._check({FLAGS: flags}, known)}
            deliver(Sample(t_s, replaced, taken.info, newest=False, anew=anew))
        return deliver(Sample(taken.t_s, checked, taken.info, anew=anew))

    def _order(self, values: Mapping[str, Readings]) -> dict[str, Readings]:
        """Order joints as in joints=[…], including joints that are not published yet."""
        values = {"pos": {}, **values} if self._joints else values
        return {
            name: {**dict.fromkeys(self._joints), **readings} if name in JOINT_FIELDS else readings
            for name, readings in values.items()
        }

    def _check(self, values: Mapping[str, Readings], known: Labels) -> dict[str, Readings]:
        checked: dict[str, Readings] = {}
        for name, readings in values.items():
            labels = known.get(name)
            if labels is None and self._profile_given:
                self._problems.add(f"{name} is left out: {OF_PROFILE}")
                continue
            found = {}
            for label, reading in readings.items():
                if labels is not None and label in labels:
                    found[label] = self._check_reading(name, label, reading)
                elif why := self._channels.explain_unknown(name, label):
                    self._problems.add(f"{name} of {quote(label)} is left out: {why}")
            if found:
                checked[name] = found
        return checked

    def _check_reading(self, name: str, label: str, reading: Reading) -> Reading:
        if type(reading) is float and not math.isfinite(reading):
            self._problems.add(f"{name} of {quote(label)} is {reading}, which is not a reading")
            return None
        return reading

    def _compare_names(self, known: Labels) -> None:
        if not self._profile_given:  # a profile defines what moves what
            self._model.check_names({name: known[name] for name in JOINT_FIELDS & known.keys()})
