"""A profile: everything specific to one robot, as immutable typed values. reader.py makes it from TOML."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from posecast_wire.mapping import JOINT, BalanceRule, SensorMount
from posecast_wire.mapping import Mapping as Meaning

PUBLIC = "public"
BALANCE = "balance"  # has limits in [thresholds] without being a field


@dataclass(frozen=True)
class FieldSpec:
    """One field. `scale`: units per code step; `deadband`: in steps; `bits`: bit names, lowest bit first.

    `strides`: label → stride, for channels that are coarser than the field: their codes are multiples of the
    stride.
    """

    name: str
    label_set: str
    labels: tuple[str, ...]
    unit: str = ""
    scale: float = 1.0
    deadband: float = 0.3
    rel: str | None = None
    bits: tuple[str, ...] = ()
    slow: bool = False
    strides: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Trajectory:
    """How to read a text file of joint angles. `header`: lines to skip; `lag_s`: lag of the servos from ref
    to pos, seconds.

    `unit`: unit of the joint columns; `fewest`: the lowest number of columns in a row.
    """

    columns: tuple[str, ...]
    fewest: int
    rate_hz: float
    unit: str = "rad"
    lag_s: float = 0.0
    header: int = 0


@dataclass(frozen=True)
class RosTopics:
    """Which ROS topics are read. `topics`: role (sources/ros/topics.py) → (pattern, site or ""); topics not
    listed are assigned by type and name. `base_frames`: the base's pose in /tf: parent frame, child frame.
    `domain`: ROS_DOMAIN_ID, None for any."""

    topics: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    domain: int | None = None
    base_frames: tuple[str, str] | None = None
    encoding: str = "json"  # of rosbridge: json, cbor


@dataclass(frozen=True)
class View:
    """What one audience receives: some of the fields, possibly with coarser `scales` (by field) and a lower
    rate.

    `info`: names of the texts it receives; None: all.
    """

    fields: tuple[str, ...]
    hz: float | None = None  # None: as fast as the agent sends
    scales: Mapping[str, float] = field(default_factory=dict)
    info: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Profile:
    """All settings of one robot. Mappings keep the order of the file; `mapping`: what channels mean for the
    model."""

    name: str
    fields: tuple[FieldSpec, ...]
    labels: Mapping[str, tuple[str, ...]]
    mapping: Meaning = field(default_factory=Meaning)
    root: str | None = None  # the model's root link
    trajectory: Trajectory | None = None
    ros: RosTopics | None = None
    csv: Mapping[str, str] = field(default_factory=dict)  # column of a table → the name it is read as
    views: Mapping[str, View] = field(default_factory=dict)  # none: everything is public
    info: tuple[str, ...] | None = None  # texts that are sent; None: all

    def find_field(self, name: str) -> FieldSpec | None:
        """The field of that name, or None."""
        return next((f for f in self.fields if f.name == name), None)

    def restrict_to_view(self, view: View) -> Profile:
        """The profile as this view sees it, without anything that belongs to fields outside the view."""
        seen, fields, names = frozenset(view.fields), list[FieldSpec](), set[str]()
        for f in self.fields:
            if f.name in seen:
                rel = f.rel if f.rel in names else None
                fields.append(replace(f, rel=rel, scale=view.scales.get(f.name, f.scale)))
                names.add(f.name)
        labels = {label for f in fields for label in f.labels}
        sites = {label.split(".")[0] for label in labels}
        moves = any(f.label_set == JOINT for f in fields)
        m = self.mapping
        limited = names | {BALANCE} if moves else names
        return replace(
            self,
            fields=tuple(fields),
            labels={f.label_set: f.labels for f in fields},
            info=view.info,
            mapping=Meaning(
                joints=m.joints if moves else {},
                sensors={site: mount for site, mount in m.sensors.items() if site in sites},
                names={k: v for k, v in m.names.items() if k in labels or k in sites},
                translated_names={
                    language: own
                    for language, words in m.translated_names.items()
                    if (own := {k: v for k, v in words.items() if k in labels or k in sites})
                },
                thresholds={k: v for k, v in m.thresholds.items() if k in limited},
                tolerances=m.tolerances if moves else {},
                severities={k: v for k, v in m.severities.items() if k in names},
                units={k: v for k, v in m.units.items() if k in names},
                sentences={k: v for k, v in m.sentences.items() if k in names},
                balance=_stand_on_links(m, sites) if moves else BalanceRule(),
            ),
        )


def _stand_on_links(m: Meaning, sites: Collection[str]) -> BalanceRule:
    """The rule for a view with only these sites. If a foot's forces are hidden, all feet are links, and the
    lowest ones carry the robot."""
    rule = m.balance
    named = [*(rule.feet or ()), *rule.soles]
    if all(foot in sites for foot in named if foot in m.sensors):
        return rule
    link_of = {foot: find_foot_link(foot, m.sensors) for foot in named}
    feet = None if rule.feet is None else tuple(dict.fromkeys(link_of[foot] for foot in rule.feet))
    return BalanceRule(feet, "lowest", {link_of[foot]: corners for foot, corners in rule.soles.items()})


def find_foot_link(foot: str, sensors: Mapping[str, SensorMount]) -> str:
    """The link of a foot: its sensor's link, otherwise the foot's own name."""
    return (sensors[foot].link or foot) if foot in sensors else foot


def find_unknown_feet(meaning: Meaning, links: Collection[str]) -> dict[str, str]:
    """The feet of [balance] that a model with these links lacks → the missing link: the sensor's link,
    otherwise the foot's own name."""
    rule = meaning.balance
    link_of = {foot: find_foot_link(foot, meaning.sensors) for foot in (*(rule.feet or ()), *rule.soles)}
    return {foot: link for foot, link in link_of.items() if link not in links}


# --- columns of a trajectory file


class Columns:
    """Looks up the field and channel of columns, in time independent of the number of channels."""

    def __init__(self, fields: Sequence[FieldSpec]) -> None:
        joints = [f for name in ("ref", "pos") for f in fields if f.name == name and f.label_set == JOINT]
        self._joints = (
            {label: (joints[0].name, i) for i, label in enumerate(joints[0].labels)} if joints else {}
        )
        self._channels: dict[str, dict[str, int | None]] = {}
        for f in fields:
            if f.name not in self._channels:
                self._channels[f.name] = _endings(f.labels)

    def find(self, column: str) -> tuple[str, int] | None:
        """The (field, channel index) of the column with this name, or None. A joint's name means its channel
        in `ref` (in `pos` if the profile has no `ref`); `FIELD.LABEL` means that field.

        In a field with one site the component is enough: `baseq.w` means `base.w` in `baseq`.
        """
        if column in self._joints:
            return self._joints[column]
        name, _, rest = column.partition(".")
        channel = self._channels.get(name, {}).get(rest)
        return None if channel is None else (name, channel)


def _endings(labels: Sequence[str]) -> dict[str, int | None]:
    """Label, or its part after the site → its channel; None where it is ambiguous."""
    found: dict[str, int | None] = {}
    for i, label in enumerate(labels):
        for ending in {label, label.partition(".")[2]}:
            found[ending] = None if ending in found else i
    return found


def find_column(fields: Sequence[FieldSpec], column: str) -> tuple[str, int] | None:
    """Look up a single column; see Columns.find."""
    return Columns(fields).find(column)
