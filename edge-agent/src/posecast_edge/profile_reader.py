"""A profile's TOML text → Profile.

Every table is optional but `[[fields]]`. An unknown key, joint, label or unit is an error that names file,
line and place: a typing mistake must not become a silently missing limb.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn, cast

from posecast_wire.mapping import (
    ANY,
    JOINT,
    SENSOR_KINDS,
    SEVERITIES,
    JointMap,
    SensorMount,
    Severity,
    Threshold,
    Xyz,
)
from posecast_wire.mapping import Mapping as Meaning
from posecast_wire.schema import BITS_MAX, FIELD_NAME

from posecast_edge.columns import find_column
from posecast_edge.joint_terms import TermError, resolve
from posecast_edge.profile import FieldSpec, Profile, RosTopics, Trajectory, View
from posecast_edge.profile_views import read_view
from posecast_edge.toml_lines import line_of, lines_of
from posecast_edge.wellknown import PLAIN, UNITS, WELL_KNOWN

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SHIPPED = Path(__file__).with_name("profiles")
SKIP = "-"  # a trajectory column nobody reads


class ProfileError(ValueError):
    """A profile that cannot be used: `file:line: where: reason`, one line."""


def find_profile(name: str) -> Path:
    """The file of that name, or the profile of that name that comes with the agent (`hubo2plus`)."""
    path, shipped = Path(name), SHIPPED / f"{name}.toml"
    return shipped if not path.exists() and shipped.parent == SHIPPED and shipped.is_file() else path


def load_profile(path: Path) -> Profile:
    """Read and parse a profile file. ProfileError when it cannot be read or does not fit."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as e:
        known = ", ".join(sorted(p.stem for p in SHIPPED.glob("*.toml")))
        hint = "" if path.suffix else f"; profiles that come with the agent: {known}"
        raise ProfileError(f"{path}: {e.strerror or e}{hint}") from None
    except UnicodeDecodeError as e:
        raise ProfileError(f"{path}: byte {e.start}: not UTF-8") from None
    return parse_profile(text, str(path))


def parse_profile(text: str, file: str = "profile") -> Profile:
    """TOML text → Profile. ProfileError `file:line: where: reason`."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as e:
        raise ProfileError(f"{file}: {e}") from None
    return Reader(file, text).profile(document)


class Reader:
    """Takes values out of a TOML document and says where one is wrong."""

    def __init__(self, file: str, text: str) -> None:
        self.file = file
        self._text = text
        self._field_paths: dict[str, str] = {}
        self.units: dict[str, dict[str, str]] = {}  # by field and label, where it is not the field's

    def fail(self, where: str, reason: str) -> NoReturn:
        line = line_of(lines_of(self._text), self._path(where))
        place = self.file if line is None else f"{self.file}:{line}"
        raise ProfileError(f"{place}: {where}: {reason}")

    def _path(self, where: str) -> str:
        """`fields.pos.unit`, as a person says it, → `fields[1].unit`, as the file has it."""
        for said, meant in self._field_paths.items():
            if where == said or where.startswith((f"{said}.", f"{said}[")):
                return meant + where[len(said) :]
        return where

    # --- values

    def table(self, value: object, where: str, keys: Sequence[str] | None = None) -> dict[str, Any]:
        if not isinstance(value, dict):
            self.fail(where, "must be a table")
        if keys is not None:
            for key in value:
                if key not in keys:
                    self.fail(f"{where}.{key}" if where else key, f"unknown key; known: {', '.join(keys)}")
        return value

    def text(self, value: object, where: str) -> str:
        if not isinstance(value, str) or not value or not value.isprintable():
            self.fail(where, f"must be a text, not {value!r}")
        return value

    def number(self, value: object, where: str, low: float = -math.inf, above: float = -math.inf) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            self.fail(where, f"must be a number, not {value!r}")
        if value < low:
            self.fail(where, f"must be at least {low:g}, not {value:g}")
        if value <= above:
            self.fail(where, f"must be above {above:g}, not {value:g}")
        return float(value)

    def texts(self, value: object, where: str) -> tuple[str, ...]:
        if not isinstance(value, list) or not value:
            self.fail(where, "must be a list of texts")
        return tuple(self.text(v, f"{where}[{i}]") for i, v in enumerate(value))

    def unique(self, value: object, where: str) -> tuple[str, ...]:
        texts = self.texts(value, where)
        for i, v in enumerate(texts):
            if v in texts[:i]:
                self.fail(f"{where}[{i}]", f"{v!r} stands there twice")
        return texts

    def xyz(self, value: object, where: str) -> Xyz:
        if not isinstance(value, list) or len(value) != 3:
            self.fail(where, "must be three numbers")
        x, y, z = (self.number(v, f"{where}[{i}]") for i, v in enumerate(value))
        return (x, y, z)

    def unit(self, value: object, where: str) -> str:
        if not isinstance(value, str) or value not in UNITS:
            self.fail(where, f"unknown unit {value!r}; known: {', '.join(u for u in UNITS if u)}")
        return UNITS[value]

    def known(self, name: str, allowed: Sequence[str], what: str, where: str) -> str:
        if name not in allowed:
            self.fail(where, f"unknown {what} {name!r}")
        return name

    # --- tables

    def profile(self, doc: dict[str, Any]) -> Profile:
        keys = (
            "robot",
            "labels",
            "fields",
            "joints",
            "sensors",
            "severity",
            "thresholds",
            "tolerance",
            "names",
            "views",
        )
        self.table(doc, "", (*keys, "trajectory", "ros"))
        robot = self.table(doc.get("robot", {}), "robot", ("name", "root"))
        labels = {
            name: self.unique(value, f"labels.{name}")
            for name, value in self.table(doc.get("labels", {}), "labels").items()
        }
        fields = self.fields(doc.get("fields"), labels)
        for f in fields:
            labels.setdefault(f.label_set, f.labels)
        by_name = {f.name: f for f in fields}
        joint = labels.get(JOINT, ())
        everything = tuple(dict.fromkeys(label for f in fields for label in f.labels))
        sensors = self.sensors(doc.get("sensors", {}))
        sites = (*sensors, *(label.split(".")[0] for label in everything))
        return Profile(
            name=self.text(robot.get("name", "robot"), "robot.name"),
            root=self.text(robot["root"], "robot.root") if "root" in robot else None,
            fields=fields,
            labels=labels,
            mapping=Meaning(
                joints=self.joints(doc.get("joints", {}), joint),
                sensors=sensors,
                names=self.names(doc.get("names", {}), (*everything, *sites)),
                thresholds=self.thresholds(doc.get("thresholds", {}), by_name),
                tolerances=self.tolerances(doc.get("tolerance", {}), joint),
                severities=self.severities(doc.get("severity", {}), by_name),
                units=self.units,
            ),
            trajectory=self.trajectory(doc["trajectory"], fields) if "trajectory" in doc else None,
            ros=self.ros(doc["ros"]) if "ros" in doc else None,
            views=self.views(doc.get("views", {}), by_name),
        )

    def fields(self, value: object, labels: Mapping[str, tuple[str, ...]]) -> tuple[FieldSpec, ...]:
        if not isinstance(value, list) or not value:
            self.fail("fields", "at least one [[fields]] is needed")
        fields: list[FieldSpec] = []
        for i, item in enumerate(value):
            fields.append(self.field(item, f"fields[{i}]", labels, fields))
        return tuple(fields)

    def field(
        self, value: object, where: str, labels: Mapping[str, tuple[str, ...]], before: Sequence[FieldSpec]
    ) -> FieldSpec:
        keys = ("name", "labels", "unit", "units", "scale", "deadband", "rel", "bits", "slow")
        item = self.table(value, where, keys)
        name = self.text(item.get("name"), f"{where}.name")
        if not FIELD_NAME.fullmatch(name):
            self.fail(f"{where}.name", f"{name!r} must be letters, digits and _, the first no digit")
        if any(f.name == name for f in before):
            self.fail(f"{where}.name", f"{name!r} stands there twice")
        self._field_paths[f"fields.{name}"] = where
        where = f"fields.{name}"
        default = WELL_KNOWN.get(name, PLAIN)
        given = item.get("labels", JOINT if default.joints else name)
        if isinstance(given, str):
            label_set, own = self.known(given, tuple(labels), "label set", f"{where}.labels"), labels[given]
        else:
            label_set, own = name, self.unique(given, f"{where}.labels")
            if label_set in labels and labels[label_set] != own:
                self.fail(f"{where}.labels", f"differs from [labels] {label_set}")
        rel = item.get("rel", default.rel if "rel" not in item else None)
        if rel is not None:
            other = next((f for f in before if f.name == rel), None)
            if other is None:
                if "rel" in item:
                    self.fail(f"{where}.rel", f"{rel!r} is no earlier field")
                rel = None
            elif len(other.labels) != len(own):
                self.fail(f"{where}.rel", f"{rel!r} has {len(other.labels)} channels, {name!r} {len(own)}")
        bits = self.unique(item["bits"], f"{where}.bits") if "bits" in item else ()
        if len(bits) > BITS_MAX:
            self.fail(f"{where}.bits", f"{len(bits)} bits; at most {BITS_MAX}")
        unit = item.get("unit", default.unit)
        others = {
            self.known(label, own, "label", f"{where}.units.{label}"): self.unit(u, f"{where}.units.{label}")
            for label, u in self.table(item.get("units", {}), f"{where}.units").items()
        }
        if others:
            self.units[name] = others
        slow = item.get("slow", False)
        if not isinstance(slow, bool):
            self.fail(f"{where}.slow", f"must be true or false, not {slow!r}")
        return FieldSpec(
            name=name,
            label_set=label_set,
            labels=own,
            unit=self.unit(unit, f"{where}.unit"),
            scale=1.0 if bits else self.number(item.get("scale", default.scale), f"{where}.scale", above=0),
            deadband=self.number(item.get("deadband", 0.3), f"{where}.deadband", low=0),
            rel=rel,
            bits=bits,
            slow=slow,
        )

    def joints(self, value: object, channels: Sequence[str]) -> dict[str, JointMap]:
        joints: dict[str, JointMap] = {}
        for name, entry in self.table(value, "joints").items():
            where = f"joints.{name}"
            item = self.table(entry, where, ("terms", "offset_rad", "offset_deg"))
            given = item.get("terms", [[name, 1.0]])
            if not isinstance(given, list):
                self.fail(f"{where}.terms", "must be a list of [channel, gain]")
            terms: list[tuple[str, float]] = []
            for i, term in enumerate(given):
                at = f"{where}.terms[{i}]"
                if not isinstance(term, list) or len(term) != 2:
                    self.fail(at, "must be [channel, gain]")
                terms.append((self.text(term[0], at), self.number(term[1], at)))
            if "offset_rad" in item and "offset_deg" in item:
                self.fail(where, "give offset_rad or offset_deg, not both")
            offset_rad = self.number(item.get("offset_rad", 0.0), f"{where}.offset_rad")
            if "offset_deg" in item:
                offset_rad = math.radians(self.number(item["offset_deg"], f"{where}.offset_deg"))
            joints[name] = JointMap(tuple(terms), offset_rad)
        try:
            return resolve(joints, channels)
        except TermError as e:
            term = "" if e.term is None else f".terms[{e.term}]"
            self.fail(f"joints.{e.joint}{term}", e.reason)

    def sensors(self, value: object) -> dict[str, SensorMount]:
        sensors: dict[str, SensorMount] = {}
        for site, entry in self.table(value, "sensors").items():
            where = f"sensors.{site}"
            item = self.table(entry, where, ("kind", "name", "link", "xyz", "rpy"))
            sensors[site] = SensorMount(
                kind=self.known(
                    self.text(item.get("kind"), f"{where}.kind"), SENSOR_KINDS, "kind", f"{where}.kind"
                ),
                name=self.text(item.get("name", site), f"{where}.name"),
                link=self.text(item["link"], f"{where}.link") if "link" in item else None,
                xyz=self.xyz(item.get("xyz", [0, 0, 0]), f"{where}.xyz"),
                rpy=self.xyz(item.get("rpy", [0, 0, 0]), f"{where}.rpy"),
            )
        return sensors

    def severities(self, value: object, fields: Mapping[str, FieldSpec]) -> dict[str, dict[str, Severity]]:
        severities: dict[str, dict[str, Severity]] = {}
        for name, entry in self.table(value, "severity").items():
            where = f"severity.{name}"
            bits = fields[self.known(name, tuple(fields), "field", where)].bits
            severities[name] = {
                self.known(bit, bits, "bit", f"{where}.{bit}"): cast(
                    Severity,
                    self.known(self.text(word, f"{where}.{bit}"), SEVERITIES, "severity", f"{where}.{bit}"),
                )
                for bit, word in self.table(entry, where).items()
            }
        return severities

    def names(self, value: object, known: Sequence[str]) -> dict[str, str]:
        return {
            self.known(k, known, "channel or site", f"names.{k}"): self.text(v, f"names.{k}")
            for k, v in self.table(value, "names").items()
        }

    def tolerances(self, value: object, joint: Sequence[str]) -> dict[str, float]:
        return {
            self.known(k, (*joint, ANY), "joint", f"tolerance.{k}"): self.number(v, f"tolerance.{k}", above=0)
            for k, v in self.table(value, "tolerance").items()
        }

    def thresholds(self, value: object, fields: Mapping[str, FieldSpec]) -> dict[str, dict[str, Threshold]]:
        thresholds: dict[str, dict[str, Threshold]] = {}
        for name, entry in self.table(value, "thresholds").items():
            labels = fields[self.known(name, tuple(fields), "field", f"thresholds.{name}")].labels
            thresholds[name] = {}
            for label, limits in self.table(entry, f"thresholds.{name}").items():
                where = f"thresholds.{name}.{label}"
                self.known(label, (*labels, ANY), "label", where)
                item = self.table(limits, where, ("low", "high", "caution"))
                low, high, caution = (
                    self.number(item[k], f"{where}.{k}") if k in item else None
                    for k in ("low", "high", "caution")
                )
                if low is None and high is None:
                    self.fail(where, "needs low or high")
                if low is not None and high is not None and low >= high:
                    self.fail(where, f"low {low:g} is not below high {high:g}")
                if caution is None:
                    caution = 1.0
                elif not 0 < caution <= 1:
                    self.fail(f"{where}.caution", f"must lie above 0 and not above 1, not {caution:g}")
                thresholds[name][label] = Threshold(low, high, caution)
        return thresholds

    def views(self, value: object, fields: Mapping[str, FieldSpec]) -> dict[str, View]:
        return {
            name: read_view(self, name, entry, fields) for name, entry in self.table(value, "views").items()
        }

    def ros(self, value: object) -> RosTopics:
        from posecast_edge.profile_ros import read_ros  # noqa: PLC0415 - few robots have it

        return read_ros(self, value)

    def trajectory(self, value: object, fields: Sequence[FieldSpec]) -> Trajectory:
        item = self.table(value, "trajectory", ("columns", "fewest", "rate_hz", "unit", "lag_s", "header"))
        columns = self.texts(item.get("columns"), "trajectory.columns")
        for i, column in enumerate(columns):
            if column != SKIP:
                if find_column(fields, column) is None:
                    self.fail(f"trajectory.columns[{i}]", f"unknown channel {column!r}")
                if column in columns[:i]:
                    self.fail(f"trajectory.columns[{i}]", f"{column!r} stands there twice")
        header = item.get("header", 0)
        if isinstance(header, bool) or not isinstance(header, int) or header < 0:
            self.fail("trajectory.header", f"must be a number of lines, not {header!r}")
        fewest = item.get("fewest", len(columns))
        if isinstance(fewest, bool) or not isinstance(fewest, int) or not 1 <= fewest <= len(columns):
            self.fail("trajectory.fewest", f"must lie in 1…{len(columns)}, not {fewest!r}")
        return Trajectory(
            columns=columns,
            fewest=fewest,
            rate_hz=self.number(item.get("rate_hz"), "trajectory.rate_hz", above=0),
            unit=self.known(item.get("unit", "rad"), ("rad", "deg"), "unit", "trajectory.unit"),
            lag_s=self.number(item.get("lag_s", 0.0), "trajectory.lag_s", low=0),
            header=header,
        )
