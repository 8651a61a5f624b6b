"""What a robot stands on, by one rule, which the page has too.

1. The feet that the profile names (`mapping.balance.feet`): sites of wrench sensors, else links; a link has
   the sensor that is mounted on it, or on one that fixed joints hold together with it. Each has the profile's
   sole, else the model's. A list without names: it stands on nothing known.
2. Else the wrench sensors on a link with a sole, or on one that is fixed to it, if there are two or more.
3. Else, where there are fewer such sensors, the model's soles if there are two or more.

A foot that is named but not there, or whose sole can't be one, or that is another one under a second name, is
left out; with ground `measured` no feet are known then.

Which of them bear is `measured` where the profile says so, else if every foot measures the force along its
normal; otherwise it is assumed of the `lowest`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from posecast_wire import Schema
from posecast_wire.mapping import Ground, SensorMount

from posecast_relay.balance.balance import BalanceGap
from posecast_relay.balance.model import BalanceModel, Sole
from posecast_relay.balance.sole import SolePlane, make_sole_plane
from posecast_relay.balance.wrench_reading import AXES, WrenchSensor
from posecast_relay.kinematics.channel_places import ChannelPlaces
from posecast_relay.kinematics.link_poses import LinkPose, compose_poses, invert_pose, place_point
from posecast_relay.kinematics.rotation import quat_of_rpy, rotate_vector
from posecast_relay.kinematics.vector import dot

# the axes of the moment that tell where a force along x, y, z acts
MOMENTS = (frozenset((1, 2)), frozenset((0, 2)), frozenset((0, 1)))


@dataclass(frozen=True)
class Foot:
    """A foot. `link`: index of the one that has the sole, in whose frame it is and its sensor, if it has one.
    `measures_force`: along the axis that is nearest to the sole's normal; `measures_pressure`: also the
    moments about both others, and so where the force acts."""

    name: str
    link: int
    sole: SolePlane
    sensor: WrenchSensor | None = None
    sole_from_sensor: LinkPose | None = None
    measures_force: bool = False
    measures_pressure: bool = False


@dataclass(frozen=True)
class FootChoice:
    """The feet of a robot, and how it is known which of them bear. `gap`: why there are none;
    `why`: what is wrong with one that was left out, in one line."""

    feet: tuple[Foot, ...]
    ground: Ground | None
    gap: BalanceGap | None = None
    why: str | None = None


def choose_feet(model: BalanceModel, schema: Schema) -> FootChoice:
    """The feet of a robot of this model whose frames have this schema."""
    rule = schema.mapping.balance
    finder = _FootFinder(model, schema)
    feet = finder.find()
    why = "; ".join(dict.fromkeys(finder.problems)) or None
    is_measured = all(foot.measures_force for foot in feet)
    ground: Ground = rule.ground or ("measured" if is_measured else "lowest")
    # without a foot that may bear, the margin is of what the robot does not stand on
    if not feet or (why is not None and ground == "measured"):
        is_old = model.soles is None and rule.feet != ()
        return FootChoice((), None, "old-bundle" if is_old else "no-feet", why)
    return FootChoice(feet, ground, None, why)


class _Mounted(NamedTuple):
    """A sensor that measures something of a wrench, on a link (index) of the model."""

    site: str
    link: int
    mount: SensorMount
    sensor: WrenchSensor


class _FootFinder:
    """Finds feet, in time proportional to the model and the schema."""

    def __init__(self, model: BalanceModel, schema: Schema) -> None:
        self._model = model
        self._rule = schema.mapping.balance
        self.problems: list[str] = []  # a line for each foot that is left out
        self._sensors: dict[str, _Mounted] = {}
        self._sensors_of_groups: dict[int, _Mounted] = {}
        self._soles = {sole.link: sole for sole in model.soles or ()}
        self._soles_of_groups: dict[int, Sole] = {}
        for sole in model.soles or ():
            self._soles_of_groups.setdefault(model.groups[sole.link], sole)
        places = ChannelPlaces(schema)
        for site, mount in schema.mapping.sensors.items():
            link = model.link_of.get(mount.link or "")
            sensor = WrenchSensor(schema, places, site)
            if link is None or not (sensor.force_axes or sensor.moment_axes):
                continue
            self._sensors[site] = _Mounted(site, link, mount, sensor)
            self._sensors_of_groups.setdefault(model.groups[link], self._sensors[site])

    def find(self) -> tuple[Foot, ...]:
        """The feet by the first part of the rule that applies."""
        if self._rule.feet is not None:
            return self._drop_twins(_list_known(map(self._find_named, self._rule.feet)))
        by_sole: dict[int, Foot | None] = {}
        for mounted in self._sensors.values():
            sole = self._find_sole(mounted.link)
            if sole is not None and by_sole.get(sole.link) is None:
                by_sole[sole.link] = self._make(mounted.site, sole, mounted)
        measured = _list_known(by_sole.values())
        if len(measured) > 1:
            return measured
        links = self._model.tree.links
        assumed = _list_known(self._make(links[sole.link], sole, None) for sole in self._soles.values())
        return assumed if len(assumed) > 1 else ()

    def _find_named(self, name: str) -> Foot | None:
        """A foot of the profile; None when the model has no such link, or nobody knows its sole."""
        own = self._sensors.get(name)
        link = self._model.link_of.get(name) if own is None else own.link
        if link is None:
            self._lack(name)
            return None
        sensor = own or self._sensors_of_groups.get(self._model.groups[link])
        corners = self._rule.soles.get(name)
        sole = self._find_sole(link) if corners is None else Sole(link, corners)
        if sole is None:
            self._lack(name)
            return None
        return self._make(name, sole, sensor)

    def _drop_twins(self, feet: Iterable[Foot]) -> tuple[Foot, ...]:
        """Feet of one sole or one sensor are one foot under two names, whose force would count twice."""
        kept: list[Foot] = []
        for foot in feet:
            twin = next((other for other in kept if _are_one(foot, other)), None)
            if twin is None:
                kept.append(foot)
            else:
                self.problems.append(f"[balance] {twin.name} and {foot.name} are one foot")
        return tuple(kept)

    def _find_sole(self, link: int) -> Sole | None:
        """The sole of a link, else of one that is fixed to it."""
        return self._soles.get(link) or self._soles_of_groups.get(self._model.groups[link])

    def _make(self, name: str, sole: Sole, mounted: _Mounted | None) -> Foot | None:
        link_from_root = invert_pose(self._model.root_from_link[sole.link])
        inside = place_point(link_from_root, self._model.inside)
        plane = make_sole_plane(self._rule.soles.get(name, sole.points), inside)
        if plane is None:
            self._lack(name)
            return None
        foot = Foot(name, sole.link, plane)
        return foot if mounted is None else self._add_sensor(foot, mounted)

    def _lack(self, name: str) -> None:
        self.problems.append(f"[balance] {name} has no sole, or one that can't be")

    def _add_sensor(self, foot: Foot, mounted: _Mounted) -> Foot:
        _, link, mount, sensor = mounted
        poses = self._model.group_from_link
        link_from_sensor = LinkPose(mount.xyz, quat_of_rpy(mount.rpy))
        sole_from_link = compose_poses(invert_pose(poses[foot.link]), poses[link])
        sole_from_sensor = compose_poses(sole_from_link, link_from_sensor)
        along = [abs(dot(foot.sole.normal, rotate_vector(sole_from_sensor.quat, axis))) for axis in AXES]
        main = along.index(max(along))
        measures_force = main in sensor.force_axes
        measures_pressure = measures_force and sensor.moment_axes >= MOMENTS[main]
        return Foot(
            foot.name, foot.link, foot.sole, sensor, sole_from_sensor, measures_force, measures_pressure
        )


def _are_one(foot: Foot, other: Foot) -> bool:
    return foot.link == other.link or (foot.sensor is not None and foot.sensor is other.sensor)


def _list_known(feet: Iterable[Foot | None]) -> tuple[Foot, ...]:
    return tuple(foot for foot in feet if foot is not None)
