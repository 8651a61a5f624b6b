"""The source behind `posecast.Robot`: takes the published readings whenever a frame is due."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping, Sequence

from posecast_wire.checked import is_text
from posecast_wire.schema import CHANNELS_MAX

from posecast_edge import kit
from posecast_edge.kit import quote
from posecast_edge.model.serve.bundle import Bundle
from posecast_edge.profile.defaults import JOINT_FIELDS
from posecast_edge.profile.types import Profile
from posecast_edge.sample import Reading, Sample
from posecast_edge.sources.base import Deliver
from posecast_edge.sources.clock import ClockCheck
from posecast_edge.sources.published.checks import ModelCheck, ProblemList
from posecast_edge.sources.published.readings import FLAGS, PublishedSlot, Readings, Taken

LOOK_S = 0.2  # the longest sleep; the end is noticed within it
SETTLE_S = 0.5  # without a profile, wait for all readings: each later one gives viewers a new schema
OF_PROFILE = "it is not in the profile"
OF_JOINTS = "it is not in joints=[…]"


class PublishedSource:
    """`joints`: the robot's joints in order, empty if not given. The agent calls `run`; `end` and
    `expect_model` may be called from any thread."""

    description = "Python"

    def __init__(
        self, slot: PublishedSlot, joints: Sequence[str], profile: Profile | None, problems: ProblemList
    ) -> None:
        self._slot, self._joints, self._problems = slot, dict.fromkeys(joints), problems
        # labels of each field of the profile; None: without one, the agent decides
        self._of_profile = {f.name: frozenset(f.labels) for f in profile.fields} if profile else None
        self._model, self._clock = ModelCheck(problems), ClockCheck(problems.add)
        self._compared: dict[str, set[str]] = {}  # joints of each field that were compared with the model
        self._ended = False

    def end(self) -> None:
        """Make `run` deliver waiting readings and return. Takes no lock, so the garbage collector may call
        it."""
        self._ended = True

    def expect_model(self, bundle: Bundle) -> None:
        """Report errors of the robot's model and, from now on, published values that do not fit it."""
        self._model.take_model(bundle)
        self._compared = {}

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver the newest readings as often as frames are sent, until `end` or `stop`."""
        first_s: float | None = None
        while not stop.is_set():
            ended = self._ended  # read it before the last take
            if not ended:
                self._slot.wait(LOOK_S)
            if self._of_profile is None and first_s is None and not ended and self._slot.published:
                first_s = time.monotonic()
                self._sleep(first_s + SETTLE_S, stop)
            taken = self._slot.take(kit.now_s())
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
        if self._of_profile is None:
            values = self._order(values)
        checked = self._check(values)
        if self._of_profile is None:  # a profile defines what moves what
            self._compare_names(checked)
            self._model.check_positions(checked)
        for t_s, flags in taken.flags:  # with all other readings: one of them may be the first sample
            replaced = {**checked, **self._check({FLAGS: flags})}
            deliver(Sample(t_s, replaced, taken.info, newest=False))
        return deliver(Sample(taken.t_s, checked, taken.info))

    def _order(self, values: Mapping[str, Readings]) -> dict[str, Readings]:
        """Order joints as in joints=[…], including joints that are not published yet."""
        values = {"pos": {}, **values} if self._joints else values
        return {
            name: {**self._joints, **readings} if name in JOINT_FIELDS else readings
            for name, readings in values.items()
        }

    def _check(self, values: Mapping[str, Readings]) -> dict[str, Readings]:
        checked: dict[str, Readings] = {}
        for name, readings in values.items():
            found = {}
            for label, reading in readings.items():
                if why := self._find_reason(name, label):
                    self._problems.add(f"{name} of {quote(label)} is left out: {why}")
                else:
                    found[label] = self._check_reading(name, label, reading)
            if found:
                checked[name] = found
        return checked

    def _find_reason(self, name: str, label: str) -> str:
        """Why a channel is left out; "" if it is not."""
        if self._of_profile is not None:
            return "" if label in self._of_profile.get(name, ()) else OF_PROFILE
        return OF_JOINTS if self._joints and name in JOINT_FIELDS and label not in self._joints else ""

    def _check_reading(self, name: str, label: str, reading: Reading) -> Reading:
        if type(reading) is float and not math.isfinite(reading):
            self._problems.add(f"{name} of {quote(label)} is {reading}, which is not a reading")
            return None
        return reading

    def _compare_names(self, values: Mapping[str, Readings]) -> None:
        """Compare names with the model's that were not compared yet."""
        compared = self._compared
        for name in JOINT_FIELDS & values.keys():
            known = compared.setdefault(name, set())
            if not values[name].keys() <= known and len(known) < CHANNELS_MAX:
                known.update(values[name])
                self._model.check_names({name: frozenset(filter(is_text, known))})
