"""Reads a profile's TOML text.

Every table except `[[fields]]` is optional. An unknown key, joint, label or unit is an error that names file,
line and place, so that a typo never makes a limb disappear without a message.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from posecast_wire.checked import SchemaError
from posecast_wire.schema import (
    ANY,
    BITS_MAX,
    CHANNELS_MAX,
    FIELD_NAME,
    JOINT,
    SENSOR_KINDS,
    SEVERITIES,
    JointMap,
    SensorMount,
    Severity,
)
from posecast_wire.schema import Mapping as Meaning

from posecast_edge.profile.balance import read_balance
from posecast_edge.profile.columns import Columns
from posecast_edge.profile.explain import read_sentences
from posecast_edge.profile.field_defaults import PLAIN, WELL_KNOWN
from posecast_edge.profile.further_errors import find_further_errors
from posecast_edge.profile.joint_mapping import TermError, resolve_entries
from posecast_edge.profile.names import read_names
from posecast_edge.profile.schema import make_schema_text
from posecast_edge.profile.thresholds import read_thresholds
from posecast_edge.profile.types import FieldSpec, Profile, RosTopics, Trajectory, View
from posecast_edge.profile.values import REASON_MAX, ProfileError, Values
from posecast_edge.profile.views import VIEWS_MAX, read_view
from posecast_edge.visible import make_visible, quote

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["ProfileError", "find_profile", "load_profile", "parse_profile"]

SHIPPED = Path(__file__).resolve().parent.parent / "profiles"
SKIP = "-"  # a trajectory column to ignore
PROFILE_BYTES_MAX = 1 << 20
NAME_MAX = 300  # characters of a file's name, in a message
DEADBAND_MAX = 1e6  # steps
HEADER_MAX = 1_000_000  # lines of a trajectory
RATE_HZ_MAX = 100_000.0
LAG_S_MAX = 60.0
# The TOML parser takes quadratic time for these: the digits of an integer, the parts of a dotted key.
_DIGITS = re.compile(r"[0-9][0-9_]{400}")
_DOTTED = re.compile(r"""(?<![A-Za-z0-9_-])(?:(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){32}""")


def find_profile(name: str) -> Path:
    """The file at this path, or the built-in profile of this name (`hubo2plus`)."""
    path, shipped = Path(name), SHIPPED / f"{name}.toml"
    try:
        return shipped if not path.exists() and shipped.parent == SHIPPED and shipped.is_file() else path
    except OSError:  # the name is too long; reading the file reports it
        return path


def load_profile(path: Path) -> Profile:
    """Read and parse a profile file. Raises ProfileError when it cannot be read or is invalid."""
    name = make_visible(str(path), NAME_MAX)
    try:
        with path.open("rb") as file:
            content = file.read(PROFILE_BYTES_MAX + 1)
    except OSError as e:
        known = ", ".join(sorted(p.stem for p in SHIPPED.glob("*.toml")))
        hint = "" if path.suffix else f"; built-in profiles: {known}"
        raise ProfileError(f"{name}: {e.strerror or e}{hint}") from None
    if len(content) > PROFILE_BYTES_MAX:
        raise ProfileError(f"{name}: over {PROFILE_BYTES_MAX} bytes")
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as e:
        line = content.count(b"\n", 0, e.start) + 1
        raise ProfileError(f"{name}:{line}: byte {e.start}: not UTF-8") from None
    return parse_profile(text, name)


def parse_profile(text: str, file: str = "profile") -> Profile:
    """Parse TOML text. Raises ProfileError for any problem: `file:line: where: reason`, of bounded length;
    its `more` has the further errors."""
    for pattern, what in (
        (_DIGITS, "a number of more than 400 digits"),
        (_DOTTED, "a key of more than 32 parts"),
    ):
        found = pattern.search(text)
        if found:
            line = text.count("\n", 0, found.start()) + 1
            raise ProfileError(f"{file}:{line}: {what}")
    try:
        document = tomllib.loads(text)
    except RecursionError:
        raise ProfileError(f"{file}: nested too deep") from None
    except ValueError as e:  # a TOMLDecodeError, or an invalid date or number
        raise ProfileError(f"{file}: {make_visible(str(e), REASON_MAX)}") from None

    def read(document: dict[str, Any]) -> Profile:
        reader = ProfileReader(file, text)
        profile = reader.build_profile(document)
        reader.check_wire_bounds(profile)
        return profile

    try:
        return read(document)
    except ProfileError as e:
        e.more = tuple(find_further_errors(document, len(text), e, read))
        raise


class ProfileReader(Values):
    """Builds each part of a profile from its TOML table. Its methods raise ProfileError."""

    def __init__(self, file: str, text: str) -> None:
        super().__init__(file, text)
        self.units: dict[
            str, dict[str, str]
        ] = {}  # by field and label, for channels whose unit is not the field's

    def check_wire_bounds(self, profile: Profile) -> None:
        """Raise ProfileError when the schema of the profile or of one of its views exceeds the wire format's
        bounds."""
        self._check(profile, "")
        for name, view in profile.views.items():
            self._check(profile.restrict_to_view(view), f"views.{name}")

    def _check(self, profile: Profile, view: str) -> None:
        try:
            make_schema_text(profile)
        except SchemaError as e:
            where, _, reason = str(e).partition(": ")
            self.fail(view or where.removeprefix("mapping."), str(e) if view else reason)

    def build_profile(self, doc: dict[str, Any]) -> Profile:
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
        self.check_table(doc, "", (*keys, "balance", "explain", "trajectory", "ros", "csv"))
        robot = self.check_table(doc.get("robot", {}), "robot", ("name", "root"))
        labels = {
            name: self.check_unique_texts(value, f"labels.{name}")
            for name, value in self.check_table(doc.get("labels", {}), "labels").items()
        }
        by_name = self.build_fields(doc.get("fields"), labels)
        fields = tuple(by_name.values())
        for f in fields:
            labels.setdefault(f.label_set, f.labels)
        joint = labels.get(JOINT, ())
        everything = tuple(dict.fromkeys(label for f in fields for label in f.labels))
        sensors = self.build_sensors(doc.get("sensors", {}))
        known = frozenset((*everything, *sensors, *(label.split(".")[0] for label in everything)))
        names, translated_names = read_names(self, doc.get("names", {}), known)
        return Profile(
            name=self.check_words(robot.get("name", "robot"), "robot.name"),
            root=self.check_text(robot["root"], "robot.root") if "root" in robot else None,
            fields=fields,
            labels=labels,
            mapping=Meaning(
                joints=self.build_joints(doc.get("joints", {}), joint),
                sensors=sensors,
                names=names,
                translated_names=translated_names,
                thresholds=read_thresholds(self, doc.get("thresholds", {}), by_name),
                tolerances=self.build_tolerances(doc.get("tolerance", {}), joint),
                severities=self.build_severities(doc.get("severity", {}), by_name),
                units=self.units,
                sentences=read_sentences(self, doc.get("explain", {}), by_name),
                balance=read_balance(self, doc.get("balance", {}), sensors),
            ),
            trajectory=self.build_trajectory(doc["trajectory"], fields) if "trajectory" in doc else None,
            ros=self.build_ros_topics(doc["ros"]) if "ros" in doc else None,
            csv={
                k: self.check_text(v, f"csv.{k}")
                for k, v in self.check_table(doc.get("csv", {}), "csv").items()
            },
            views=self.build_views(doc.get("views", {}), by_name),
        )

    def build_fields(self, value: object, labels: Mapping[str, tuple[str, ...]]) -> dict[str, FieldSpec]:
        if not isinstance(value, list) or not value:
            self.fail("fields", "at least one [[fields]] is needed")
        fields: dict[str, FieldSpec] = {}
        size = 0
        for i, item in enumerate(value):
            spec = self.build_field(item, f"fields[{i}]", labels, fields)
            fields[spec.name] = spec
            size += len(spec.labels)
            if size > CHANNELS_MAX:
                self.fail(f"fields[{i}]", f"more than {CHANNELS_MAX} channels in all")
        return fields

    def build_field(
        self,
        value: object,
        where: str,
        labels: Mapping[str, tuple[str, ...]],
        before: Mapping[str, FieldSpec],
    ) -> FieldSpec:
        keys = ("name", "labels", "unit", "units", "scale", "deadband", "rel", "bits", "slow")
        item = self.check_table(value, where, keys)
        name = self.check_text(item.get("name"), f"{where}.name")
        if not FIELD_NAME.fullmatch(name):
            self.fail(
                f"{where}.name",
                f"{quote(name)} must be letters, digits and _, no digit first",
            )
        if name in before:
            self.fail(f"{where}.name", f"{name!r} is listed twice")
        self.field_paths[f"fields.{name}"] = where
        where = f"fields.{name}"
        default = WELL_KNOWN.get(name, PLAIN)
        given = item.get("labels", JOINT if default.joints else name)
        if isinstance(given, str):
            label_set, own = self.check_choice(given, labels, "label set", f"{where}.labels"), labels[given]
        else:
            label_set, own = name, self.check_unique_texts(given, f"{where}.labels")
            if label_set in labels and labels[label_set] != own:
                self.fail(f"{where}.labels", f"differs from [labels] {label_set}")
        rel = item.get("rel", default.rel if "rel" not in item else None)
        if rel is not None:
            other = before.get(rel) if isinstance(rel, str) else None
            if other is None:
                if "rel" in item:
                    self.fail(f"{where}.rel", f"{quote(rel)} is not an earlier field")
                rel = None
            elif len(other.labels) != len(own):
                self.fail(
                    f"{where}.rel", f"{rel!r} has {len(other.labels)} channels, but {name!r} has {len(own)}"
                )
        bits = self.check_unique_texts(item["bits"], f"{where}.bits") if "bits" in item else ()
        if len(bits) > BITS_MAX:
            self.fail(f"{where}.bits", f"{len(bits)} bits; at most {BITS_MAX}")
        unit = item.get("unit", default.unit)
        known = frozenset(own) if "units" in item else ()
        others = {
            self.check_choice(label, known, "label", f"{where}.units.{label}"): self.check_unit(
                u, f"{where}.units.{label}"
            )
            for label, u in self.check_table(item.get("units", {}), f"{where}.units").items()
        }
        if others:
            self.units[name] = others
        slow = item.get("slow", False)
        if not isinstance(slow, bool):
            self.fail(f"{where}.slow", f"must be true or false, not {quote(slow)}")
        return FieldSpec(
            name=name,
            label_set=label_set,
            labels=own,
            unit=self.check_unit(unit, f"{where}.unit"),
            scale=1.0
            if bits
            else self.check_number(item.get("scale", default.scale), f"{where}.scale", above=0),
            deadband=self.check_number(
                item.get("deadband", 0.3), f"{where}.deadband", low=0, most=DEADBAND_MAX
            ),
            rel=rel,
            bits=bits,
            slow=slow,
        )

    def build_joints(self, value: object, channels: Sequence[str]) -> dict[str, JointMap]:
        joints: dict[str, JointMap] = {}
        for name, entry in self.check_table(value, "joints").items():
            where = f"joints.{name}"
            item = self.check_table(entry, where, ("terms", "offset_rad", "offset_deg"))
            given = item.get("terms", [[name, 1.0]])
            if not isinstance(given, list):
                self.fail(f"{where}.terms", "must be a list of [channel, gain]")
            terms: list[tuple[str, float]] = []
            for i, term in enumerate(given):
                at = f"{where}.terms[{i}]"
                if not isinstance(term, list) or len(term) != 2:
                    self.fail(at, "must be [channel, gain]")
                terms.append((self.check_text(term[0], at), self.check_number(term[1], at)))
            if "offset_rad" in item and "offset_deg" in item:
                self.fail(where, "give offset_rad or offset_deg, not both")
            offset_rad = self.check_number(item.get("offset_rad", 0.0), f"{where}.offset_rad")
            if "offset_deg" in item:
                offset_rad = math.radians(self.check_number(item["offset_deg"], f"{where}.offset_deg"))
            joints[name] = JointMap(tuple(terms), offset_rad)
        try:
            return resolve_entries(joints, channels)
        except TermError as e:
            term = "" if e.term is None else f".terms[{e.term}]"
            self.fail(f"joints.{e.joint}{term}", e.reason)

    def build_sensors(self, value: object) -> dict[str, SensorMount]:
        sensors: dict[str, SensorMount] = {}
        for site, entry in self.check_table(value, "sensors").items():
            where = f"sensors.{site}"
            item = self.check_table(entry, where, ("kind", "name", "link", "xyz", "rpy"))
            sensors[site] = SensorMount(
                kind=self.check_choice(
                    self.check_text(item.get("kind"), f"{where}.kind"), SENSOR_KINDS, "kind", f"{where}.kind"
                ),
                name=self.check_words(item.get("name", site), f"{where}.name"),
                link=self.check_text(item["link"], f"{where}.link") if "link" in item else None,
                xyz=self.check_xyz(item.get("xyz", [0, 0, 0]), f"{where}.xyz"),
                rpy=self.check_xyz(item.get("rpy", [0, 0, 0]), f"{where}.rpy"),
            )
        return sensors

    def build_severities(
        self, value: object, fields: Mapping[str, FieldSpec]
    ) -> dict[str, dict[str, Severity]]:
        severities: dict[str, dict[str, Severity]] = {}
        for name, entry in self.check_table(value, "severity").items():
            where = f"severity.{name}"
            bits = fields[self.check_choice(name, fields, "field", where)].bits
            severities[name] = {
                self.check_choice(bit, bits, "bit", f"{where}.{bit}"): cast(
                    Severity,
                    self.check_choice(
                        self.check_text(word, f"{where}.{bit}"), SEVERITIES, "severity", f"{where}.{bit}"
                    ),
                )
                for bit, word in self.check_table(entry, where).items()
            }
        return severities

    def build_tolerances(self, value: object, joint: Sequence[str]) -> dict[str, float]:
        known = frozenset((*joint, ANY))
        return {
            self.check_choice(k, known, "joint", f"tolerance.{k}"): self.check_number(
                v, f"tolerance.{k}", above=0
            )
            for k, v in self.check_table(value, "tolerance").items()
        }

    def build_views(self, value: object, fields: Mapping[str, FieldSpec]) -> dict[str, View]:
        views: dict[str, View] = {}
        for name, entry in self.check_table(value, "views").items():
            if len(views) == VIEWS_MAX:
                self.fail(f"views.{name}", f"more than {VIEWS_MAX} views")
            views[name] = read_view(self, name, entry, fields)
        return views

    def build_ros_topics(self, value: object) -> RosTopics:
        from posecast_edge.profile.ros import read_ros  # noqa: PLC0415 - few robots have it

        return read_ros(self, value)

    def build_trajectory(self, value: object, fields: Sequence[FieldSpec]) -> Trajectory:
        item = self.check_table(
            value, "trajectory", ("columns", "fewest", "rate_hz", "unit", "lag_s", "header")
        )
        columns = self.check_texts(item.get("columns"), "trajectory.columns")
        known, seen = Columns(fields), set[str]()
        for i, column in enumerate(columns):
            if column == SKIP:
                continue
            if known.find(column) is None:
                self.fail(f"trajectory.columns[{i}]", f"unknown channel {quote(column)}")
            if column in seen:
                self.fail(f"trajectory.columns[{i}]", f"{quote(column)} is listed twice")
            seen.add(column)
        header = self.check_integer(item.get("header", 0), "trajectory.header", 0, HEADER_MAX)
        fewest = self.check_integer(item.get("fewest", len(columns)), "trajectory.fewest", 1, len(columns))
        return Trajectory(
            columns=columns,
            fewest=fewest,
            rate_hz=self.check_number(item.get("rate_hz"), "trajectory.rate_hz", above=0, most=RATE_HZ_MAX),
            unit=self.check_choice(item.get("unit", "rad"), ("rad", "deg"), "unit", "trajectory.unit"),
            lag_s=self.check_number(item.get("lag_s", 0.0), "trajectory.lag_s", low=0, most=LAG_S_MAX),
            header=header,
        )
