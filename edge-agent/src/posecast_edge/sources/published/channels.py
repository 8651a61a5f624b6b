"""The fields and labels that a program publishes: set by the first sample, and extended by later ones.

Each extension gives viewers a new schema. So it waits a moment for other new names, and the number of
extensions is limited, in case a program keeps inventing names.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from posecast_wire.schema import CHANNELS_MAX, Schema, SchemaError

from posecast_edge.profile.field_defaults import WELL_KNOWN
from posecast_edge.profile.schema import infer_profile, make_schema_text
from posecast_edge.profile.types import Profile
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.published.problems import ProblemList
from posecast_edge.sources.published.slot import Readings

JOINT_FIELDS = frozenset(name for name, known in WELL_KNOWN.items() if known.joints)
GROW_EVERY_S = 1.0
GROWTHS_MAX = 32  # attempts
FIELDS_MAX = 128  # with this many, no more are added
GROWN_BYTES_MAX = 1 << 20  # of all schemas made by extensions
FULL = (
    f"further new names are left out: new names came {GROWTHS_MAX} times, or the robot would be too large; "
    "publish all names from the start, or give profile=…"
)
OF_PROFILE = "it is not in the profile"
OF_JOINTS = "it is not in joints=[…]"

Labels = Mapping[str, frozenset[str]]  # of each field


class PublishedChannels:
    """The channels of one robot. `joints`: its joints in order, empty if not given; `profile`: if given,
    defines all channels in advance."""

    def __init__(
        self, robot: str, joints: Sequence[str], profile: Profile | None, problems: ProblemList
    ) -> None:
        self._robot, self._joints, self._problems = robot, frozenset(joints), problems
        self._profile_given = profile is not None
        self.labels: Labels | None = _labels_by_field(profile) if profile else None  # None: unknown yet
        self._refused: set[tuple[str, str]] = set()  # names that no schema can be made from
        self._tries = 0
        self._bytes = 0
        self._tried_s = -math.inf

    def learn(self, values: Mapping[str, Readings]) -> None:
        """Use the first sample's fields and labels, as far as a schema can be made from them."""
        own = {name: self._keep_own(name, readings) for name, readings in values.items()}
        profile = self._infer(own)
        if profile is None:  # don't fail because of one field
            own = {name: readings for name, readings in own.items() if self._infer({name: readings})}
            profile = self._infer(own) if own else None
        if profile is not None:
            self.labels = _labels_by_field(profile)

    def grow(self, values: Mapping[str, Readings], now_s: float) -> bool:
        """Add new fields and labels, if it is time for that (`now_s`: monotonic seconds). Returns whether any
        were added."""
        if self._profile_given or self.labels is None or now_s - self._tried_s < GROW_EVERY_S:
            return False
        news = self._find_new(values)
        if not news:
            return False
        if self.is_full:
            self._problems.add(FULL)
            return False
        self._tries += 1
        self._tried_s = now_s
        if self._add(news):
            return True
        # don't fail because of one field
        grown = False
        for name, labels in news.items():
            if len(news) > 1 and self._add({name: labels}):
                grown = True
            elif len(self._refused) <= CHANNELS_MAX:
                self._refused |= {(name, label) for label in labels}
        return grown

    @property
    def is_full(self) -> bool:
        """Whether no more names are added."""
        return (
            self._tries >= GROWTHS_MAX
            or self._bytes >= GROWN_BYTES_MAX
            or len(self.labels or ()) >= FIELDS_MAX
            or len(self._refused) > CHANNELS_MAX
        )

    def explain_unknown(self, name: str, label: str) -> str:
        """Why a channel is left out permanently; "" when it may still be added."""
        if self._profile_given:
            return OF_PROFILE
        return OF_JOINTS if self._is_foreign(name, label) else ""

    def _find_new(self, values: Mapping[str, Readings]) -> dict[str, list[str]]:
        assert self.labels is not None
        none: frozenset[str] = frozenset()
        news: dict[str, list[str]] = {}
        for name, readings in values.items():
            known = self.labels.get(name, none)
            if readings.keys() <= known:
                continue
            labels = [
                label
                for label in readings
                if label not in known
                and (name, label) not in self._refused
                and not self._is_foreign(name, label)
            ]
            if labels:
                news[name] = labels
        return news

    def _add(self, news: Mapping[str, Sequence[str]]) -> bool:
        assert self.labels is not None
        values: dict[str, Readings] = {n: dict.fromkeys(labels) for n, labels in self.labels.items()}
        for name, labels in news.items():
            values.setdefault(name, {}).update(dict.fromkeys(labels))
        profile = self._infer(values, "new names are left out: ")
        if profile is None:
            return False
        self._bytes += len(make_schema_text(profile))
        self.labels = _labels_by_field(profile)
        return True

    def _infer(self, values: Mapping[str, Readings], prefix: str = "") -> Profile | None:
        try:
            profile = infer_profile(self._robot, Sample(0.0, values))
            Schema.parse(make_schema_text(profile))
        except (SourceError, SchemaError) as e:
            self._problems.add(f"{prefix or ', '.join(values)[:100] + ': '}{e}")
            return None
        return profile

    def _keep_own(self, name: str, readings: Readings) -> Readings:
        return {k: v for k, v in readings.items() if not self._is_foreign(name, k)}

    def _is_foreign(self, name: str, label: str) -> bool:
        return bool(self._joints) and name in JOINT_FIELDS and label not in self._joints


def _labels_by_field(profile: Profile) -> Labels:
    return {f.name: frozenset(f.labels) for f in profile.fields}
