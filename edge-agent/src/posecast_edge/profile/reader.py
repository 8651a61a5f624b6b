"""Reads a profile's TOML text.

Every table except `[[fields]]` is optional. An unknown key, joint, label or unit is an error that names file,
line and place, so that a typo never makes a limb disappear without a message.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

from posecast_wire.checked import SchemaError
from posecast_wire.keys import check_name
from posecast_wire.schema import (
    ANY,
    BITS_MAX,
    CHANNELS_MAX,
    CORNERS_MAX,
    FEET_MAX,
    FIELD_NAME,
    GROUNDS,
    JOINT,
    SENSOR_KINDS,
    SEVERITIES,
    BalanceRule,
    Ground,
    JointMap,
    SensorMount,
    Sentence,
    Severity,
    Threshold,
    Xyz,
)
from posecast_wire.schema import Mapping as Meaning

from posecast_edge.kit import make_visible, quote
from posecast_edge.profile.defaults import PLAIN, WELL_KNOWN
from posecast_edge.profile.schema import make_schema_text
from posecast_edge.profile.types import (
    BALANCE,
    Columns,
    FieldSpec,
    Profile,
    RosTopics,
    Trajectory,
    View,
    find_foot_link,
)
from posecast_edge.profile.values import REASON_MAX, ProfileError, Values

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
SENTENCE_MAX = 200  # characters, as on the wire
SENTENCES_BYTES_MAX = 32 << 10  # of all sentences in UTF-8: every viewer gets them before the first frame
# a sentence may show these of the joint that has the bit, each with its unit
SENTENCE_VALUES = ("ref", "pos", "error", "vel", "effort", "cur", "temp")
_OPTIONAL_PART = re.compile(r"\[([^\[\]]*)\]")
_PLACE = re.compile(r"\{([^{}]*)\}")
MARGIN = "margin"  # mm, from the centre of mass to the edge of the support area
WRENCH = "wrench"
AREA_MIN_M2 = 1e-4
REACH_MAX_M = 10.0
VIEWS_MAX = 8  # a relay accepts no more per robot
HZ_MIN = 0.1  # as on the wire
ROLES = ("pos", "ref", "imu", "wrench", "battery", "diagnostics", "base", "description")
SITED = ("imu", "wrench", "battery")  # roles whose topics may be given a site
ENCODINGS = ("json", "cbor")  # of rosbridge
TOPIC_PATTERN = re.compile(r"(?:/(?:\*\*|[A-Za-z0-9_*]+))+")
SITE_NAME = re.compile(r"[^.\s/]+")
ARROW = re.compile(r"→|->")
FRAME_NAME = re.compile(r"\S{1,200}")
DOMAIN_MAX = 232  # ROS 2's
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
    """Builds each part of a profile from its TOML table. Its methods raise ProfileError, which names
    the line."""

    def __init__(self, file: str, text: str) -> None:
        super().__init__(file, text)
        # by field and label, for channels whose unit is not the field's
        self.units: dict[str, dict[str, str]] = {}

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
        names, translated_names = self.build_names(doc.get("names", {}), known)
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
                thresholds=self.build_thresholds(doc.get("thresholds", {}), by_name),
                tolerances=self.build_tolerances(doc.get("tolerance", {}), joint),
                severities=self.build_severities(doc.get("severity", {}), by_name),
                units=self.units,
                sentences=self.build_sentences(doc.get("explain", {}), by_name),
                balance=self.build_balance(doc.get("balance", {}), sensors),
            ),
            trajectory=self.build_trajectory(doc["trajectory"], fields) if "trajectory" in doc else None,
            ros=self.build_ros_topics(doc["ros"]) if "ros" in doc else None,
            csv={
                k: self.check_text(v, f"csv.{k}")
                for k, v in self.check_table(doc.get("csv", {}), "csv").items()
            },
            views=self.build_views(doc.get("views", {}), by_name),
        )

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

    # --- [[fields]]

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
            self.fail(f"{where}.name", f"{quote(name)} must be letters, digits and _, no digit first")
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
        others = self.check_entries(item.get("units", {}), f"{where}.units", own, "label", self.check_unit)
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

    # --- [joints], [sensors]

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

    # --- [names]

    def build_names(
        self, value: object, known: Collection[str]
    ) -> tuple[dict[str, str], dict[str, dict[str, str]]]:
        """Parse [names] into channel or site → display name, and its subtables ([names.ko]) into language →
        channel or site → display name."""
        names: dict[str, str] = {}
        translated: dict[str, dict[str, str]] = {}
        for key, entry in self.check_table(value, "names").items():
            at = f"names.{key}"
            if isinstance(entry, dict):
                self.check_language(key, at, translated)
                translated[key] = {
                    k: self._check_display_name(k, v, known, f"{at}.{k}") for k, v in entry.items()
                }
            else:
                names[key] = self._check_display_name(key, entry, known, at)
        return names, translated

    def _check_display_name(self, name: str, words: object, known: Collection[str], where: str) -> str:
        self.check_choice(name, known, "channel or site", where)
        return self.check_words(words, where)

    # --- [severity], [tolerance], [thresholds]

    def build_severities(
        self, value: object, fields: Mapping[str, FieldSpec]
    ) -> dict[str, dict[str, Severity]]:
        severities: dict[str, dict[str, Severity]] = {}
        for name, entry in self.check_table(value, "severity").items():
            where = f"severity.{name}"
            bits = fields[self.check_choice(name, fields, "field", where)].bits
            severities[name] = self.check_entries(entry, where, bits, "bit", self._check_severity)
        return severities

    def _check_severity(self, value: object, where: str) -> Severity:
        return cast(Severity, self.check_choice(self.check_text(value, where), SEVERITIES, "severity", where))

    def build_tolerances(self, value: object, joint: Sequence[str]) -> dict[str, float]:
        return self.check_entries(value, "tolerance", (*joint, ANY), "joint", self._check_positive)

    def _check_positive(self, value: object, where: str) -> float:
        return self.check_number(value, where, above=0)

    def build_thresholds(
        self, value: object, fields: Mapping[str, FieldSpec]
    ) -> dict[str, dict[str, Threshold]]:
        """Parse [thresholds] into field → label → limits. Besides the fields it may have `balance` →
        `margin`."""
        thresholds: dict[str, dict[str, Threshold]] = {}
        for name, entry in self.check_table(value, "thresholds").items():
            where = f"thresholds.{name}"
            own = (MARGIN,) if name == BALANCE else ()
            if own and name not in fields:
                labels = own
            else:
                field = fields[self.check_choice(name, fields, "field", where)]
                labels = (*field.labels, ANY, *own)
            thresholds[name] = self.check_entries(entry, where, labels, "label", self._build_limits)
        return thresholds

    def _build_limits(self, value: object, where: str) -> Threshold:
        item = self.check_table(value, where, ("low", "high", "caution"))
        low, high, caution = (
            self.check_number(item[k], f"{where}.{k}") if k in item else None
            for k in ("low", "high", "caution")
        )
        if low is None and high is None:
            self.fail(where, "give low, high or both")
        if low is not None and high is not None and low >= high:
            self.fail(where, f"low {low:g} is not below high {high:g}")
        if caution is None:
            caution = 1.0
        elif not 0 < caution <= 1:
            self.fail(f"{where}.caution", f"must be above 0 and at most 1, not {caution:g}")
        return Threshold(low, high, caution)

    # --- [explain]: what a bit means, in each language of the profile

    def build_sentences(
        self, value: object, fields: Mapping[str, FieldSpec]
    ) -> dict[str, dict[str, dict[str, Sentence]]]:
        """Parse [explain] into field → bit → language → sentence."""
        found: dict[str, dict[str, dict[str, Sentence]]] = {}
        size = 0
        for name, entry in self.check_table(value, "explain").items():
            where = f"explain.{name}"
            bits = fields[self.check_choice(name, fields, "field", where)].bits
            found[name] = {}
            for bit, by_language in self.check_table(entry, where).items():
                at = f"{where}.{bit}"
                self.check_choice(bit, bits, "bit", at)
                found[name][bit] = self._build_languages(by_language, at)
                size += sum(len((s.say + (s.why or "")).encode()) for s in found[name][bit].values())
                if size > SENTENCES_BYTES_MAX:
                    self.fail(at, f"more than {SENTENCES_BYTES_MAX} bytes of sentences in all")
        return found

    def _build_languages(self, value: object, where: str) -> dict[str, Sentence]:
        sentences: dict[str, Sentence] = {}
        for language, entry in self.check_table(value, where).items():
            at = f"{where}.{language}"
            self.check_language(language, at, sentences)
            item = self.check_table(entry, at, ("say", "why"))
            say = self._check_sentence(item.get("say"), f"{at}.say")
            self._check_places(say, f"{at}.say")
            sentences[language] = Sentence(
                say, self._check_sentence(item["why"], f"{at}.why") if "why" in item else None
            )
        return sentences

    def _check_sentence(self, value: object, where: str) -> str:
        text = self.check_words(value, where)
        if len(text) > SENTENCE_MAX:
            self.fail(where, f"has {len(text)} characters; at most {SENTENCE_MAX}")
        return text

    def _check_places(self, say: str, where: str) -> None:
        """Check that each value is in an optional part of the sentence: it may be unknown."""
        surely, maybe = _OPTIONAL_PART.sub("", say), _OPTIONAL_PART.findall(say)
        for text, allowed in (
            (surely, ("joint",)),
            *((part, ("joint", "age", *SENTENCE_VALUES)) for part in maybe),
        ):
            for place in _PLACE.findall(text):
                if place not in ("joint", "age", *SENTENCE_VALUES):
                    known = ", ".join(("joint", "age", *SENTENCE_VALUES))
                    self.fail(where, f"unknown place {{{place}}}; known: {known}")
                if place not in allowed:
                    self.fail(where, f"{{{place}}} may be unknown: put its part of the sentence in [ ]")
            if any(mark in _PLACE.sub("", text) for mark in "{}[]"):
                self.fail(where, "braces and brackets must come in pairs, not nested in their own kind")

    # --- [balance]: what the robot stands on, if model and sensors don't define it

    def build_balance(self, value: object, sensors: Mapping[str, SensorMount]) -> BalanceRule:
        """Parse [balance]. A foot is the site of a wrench sensor, otherwise a link of the model."""
        item = self.check_table(value, "balance", ("feet", "ground", "soles"))
        ground = item.get("ground")
        if ground is not None:
            self.check_choice(ground, GROUNDS, "ground", "balance.ground")
        feet = self._build_feet(item["feet"], sensors, ground == "measured") if "feet" in item else None
        soles = self.check_table(item.get("soles", {}), "balance.soles")
        if len(soles) > FEET_MAX:
            self.fail("balance.soles", f"more than {FEET_MAX} soles")
        for foot in soles:
            if feet is not None and foot not in feet:
                self.fail(f"balance.soles.{foot}", f"{quote(foot)} is not one of the feet")
        read = {foot: self._build_sole(points, f"balance.soles.{foot}") for foot, points in soles.items()}
        return BalanceRule(feet, cast("Ground | None", ground), read)

    def _build_feet(
        self, value: object, sensors: Mapping[str, SensorMount], is_measured: bool
    ) -> tuple[str, ...]:
        feet = () if value == [] else self.check_unique_texts(value, "balance.feet")
        if len(feet) > FEET_MAX:
            self.fail("balance.feet", f"more than {FEET_MAX} feet")
        for i, foot in enumerate(feet):
            where, mount = f"balance.feet[{i}]", sensors.get(foot)
            if mount is None:
                if is_measured:
                    self.fail(where, f"unknown site {quote(foot)}: list feet with a sensor in [sensors]")
            elif mount.kind != WRENCH:
                self.fail(where, f"{quote(foot)} is a sensor of kind {mount.kind}, not {WRENCH}")
            elif mount.link is None:
                self.fail(where, f"sensor {quote(foot)} has no link in [sensors]")
        self._refuse_one_link_twice(feet, sensors)
        return feet

    def _refuse_one_link_twice(self, feet: Collection[str], sensors: Mapping[str, SensorMount]) -> None:
        """Two feet on one link are an error: its force would count twice."""
        foot_on: dict[str, str] = {}
        for i, foot in enumerate(feet):
            link = find_foot_link(foot, sensors)
            if link in foot_on:
                both = f"{quote(foot_on[link])} and {quote(foot)}"
                self.fail(f"balance.feet[{i}]", f"{both} are the same foot: both are on link {quote(link)}")
            foot_on[link] = foot

    def _build_sole(self, value: object, where: str) -> tuple[Xyz, ...]:
        if not isinstance(value, list) or not 3 <= len(value) <= CORNERS_MAX:
            self.fail(where, f"must be a list of 3 to {CORNERS_MAX} corners, each of three numbers")
        corners = tuple(self.check_xyz(corner, f"{where}[{i}]") for i, corner in enumerate(value))
        for i, corner in enumerate(corners):
            if max(map(abs, corner)) > REACH_MAX_M:
                self.fail(
                    f"{where}[{i}]", f"more than {REACH_MAX_M:g} m from its link; give corners in metres"
                )
        if compute_area(corners) < AREA_MIN_M2:
            self.fail(where, "its corners enclose under 1 cm²; give them in metres, in order around the sole")
        return corners

    # --- [views]: which part of the robot each audience receives

    def build_views(self, value: object, fields: Mapping[str, FieldSpec]) -> dict[str, View]:
        views: dict[str, View] = {}
        for name, entry in self.check_table(value, "views").items():
            if len(views) == VIEWS_MAX:
                self.fail(f"views.{name}", f"more than {VIEWS_MAX} views")
            views[name] = self._build_view(name, entry, fields)
        return views

    def _build_view(self, name: str, value: object, fields: Mapping[str, FieldSpec]) -> View:
        """Parse the table of one view."""
        where = f"views.{name}"
        try:
            check_name("view", name)
        except ValueError as e:
            self.fail(where, str(e))
        item = self.check_table(value, where, ("fields", "hz", "scales", "info"))
        seen = self.check_unique_texts(item.get("fields", list(fields)), f"{where}.fields")
        for i, field_name in enumerate(seen):
            self.check_choice(field_name, fields, "field", f"{where}.fields[{i}]")
        given, at = item.get("scales", {}), f"{where}.scales"
        scales = self.check_entries(given, at, seen, "field of this view", self._check_positive)
        for k in scales:
            if fields[k].bits:
                self.fail(f"{where}.scales.{k}", "a field of bits has no scale")
        hz = self.check_number(item["hz"], f"{where}.hz", low=HZ_MIN) if "hz" in item else None
        return View(seen, hz, scales, self._list_view_texts(item, where))

    def _list_view_texts(self, item: Mapping[str, object], where: str) -> tuple[str, ...] | None:
        """The texts of a view. A view that lists fields must list its texts too, so that a source's texts (a
        diagnosis, an operator's name) are never shown by accident.
        """
        if "info" not in item:
            return () if "fields" in item else None
        return () if item["info"] == [] else self.check_unique_texts(item["info"], f"{where}.info")

    # --- [ros]: which topics are read, and in which role

    def build_ros_topics(self, value: object) -> RosTopics:
        item = self.check_table(value, "ros", (*ROLES, "domain", "encoding"))
        domain = self.check_integer(item["domain"], "ros.domain", 0, DOMAIN_MAX) if "domain" in item else None
        encoding = self.check_choice(item.get("encoding", "json"), ENCODINGS, "encoding", "ros.encoding")
        frames = self._build_base_frames(item["base"]) if "base" in item else None
        given = [role for role in ROLES if role in item and not (frames and role == "base")]
        topics = {role: self._build_patterns(item[role], role) for role in given}
        return RosTopics(topics, domain, frames, encoding)

    def _build_base_frames(self, value: object) -> tuple[str, str] | None:
        """The two frames of `odom→base_link` or `odom->base_link`; None for topic names."""
        if not isinstance(value, str) or not ARROW.search(value):
            return None
        names = [name.strip().strip("/") for name in ARROW.split(value)]
        if len(names) != 2 or not all(FRAME_NAME.fullmatch(name) for name in names) or names[0] == names[1]:
            self.fail("ros.base", f"{quote(value)} is not a pair of frames such as odom→base_link")
        return names[0], names[1]

    def _build_patterns(self, value: object, role: str) -> tuple[tuple[str, str], ...]:
        """Parse `"/a"`, `["/a", "/b/*"]`, `[]` for none, or for a sensor `{ site = "/a" }`."""
        where = f"ros.{role}"
        if isinstance(value, dict) and role in SITED:
            for site in value:
                if not SITE_NAME.fullmatch(site):
                    self.fail(f"{where}.{site}", "a site must be one word without a dot")
            return tuple((self._check_pattern(text, f"{where}.{site}"), site) for site, text in value.items())
        listed = value if isinstance(value, list) else [value]
        return tuple((self._check_pattern(text, where), "") for text in listed)

    def _check_pattern(self, value: object, where: str) -> str:
        text = self.check_text(value, where)
        if not TOPIC_PATTERN.fullmatch(text):
            self.fail(where, f"{quote(text)} is not a topic such as /joint_states, /arm/*/state or /**/imu")
        return text

    # --- [trajectory]

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


def compute_area(corners: Sequence[Xyz]) -> float:
    """The area of a polygon in space, m² (half the length of its Newell vector)."""
    x0, y0, z0 = corners[0]
    total = [0.0, 0.0, 0.0]
    for one, other in pairwise(corners):  # each pair forms a triangle with the first corner
        a, b, c = one[0] - x0, one[1] - y0, one[2] - z0
        d, e, f = other[0] - x0, other[1] - y0, other[2] - z0
        for i, part in enumerate((b * f - c * e, c * d - a * f, a * e - b * d)):
            total[i] += part
    return math.hypot(*total) / 2


# --- further errors: removes the entry that caused the last error, then reads the document again

ERRORS_MAX = 20  # of one profile, the first included
READ_BYTES_MAX = 1 << 20  # for all reads together
# Entries that other tables refer to, and the names that are unknown there once the entry is removed.
_DEFINED = (
    (re.compile(r"labels\..*|fields\[\d+\]\.labels"), "label|label set|joint|channel|name|site|place"),
    (re.compile(r"fields\[\d+\]\.bits"), "bit"),
    (re.compile(r"sensors\.[^.]+"), "name|site|place"),
)


def find_further_errors(
    document: dict[str, Any], size: int, first: ProfileError, read: Callable[[dict[str, Any]], object]
) -> Iterator[str]:
    """The lines of the errors after `first`. Removes entries from `document`. `size`: bytes of its text;
    `read` raises the next ProfileError, if any."""
    error, seen, lost = first, {first.path}, set[str]()
    for _ in range(min(ERRORS_MAX, READ_BYTES_MAX // max(size, 1)) - 1):
        removed = _remove(document, error.path)
        if removed is None:
            return
        lost |= {kinds for entry, kinds in _DEFINED if entry.fullmatch(removed)}
        try:
            read(document)
        except ProfileError as next_error:
            error = next_error
        else:
            return
        # a removed entry may be required: the next error reports it as missing, which is not a new error
        is_missed = error.path in seen or error.path == removed.rpartition(".")[0]
        seen.add(error.path)
        if not is_missed and not any(re.search(f": unknown (?:{kinds}) ", str(error)) for kinds in lost):
            yield str(error)


def _remove(document: dict[str, Any], path: str) -> str | None:
    """Delete the entry at `path`, or the nearest table around it, and return its path; None when that is a
    whole field or the document. Keeps list items, because errors name them by position."""
    owner: dict[str, Any] = document
    held: tuple[dict[str, Any], str, str] | None = None
    walked, rest = "", path
    while rest:
        begins = (k for k in owner if rest.startswith(k) and rest[len(k) : len(k) + 1] in ("", ".", "["))
        key = max(begins, key=len, default=None)
        if key is None:
            break
        walked, rest = f"{walked}.{key}" if walked else key, rest[len(key) :].removeprefix(".")
        held, value = (owner, key, walked), owner[key]
        field = re.match(r"\[(\d+)\]\.?", rest) if walked == "fields" else None
        if field and isinstance(value, list) and isinstance(value[int(field[1])], dict):
            held, value = None, value[int(field[1])]
            walked, rest = f"fields[{field[1]}]", rest[field.end() :]
        if not isinstance(value, dict):
            break
        owner = value
    if held is None or held[2] == "fields":
        return None
    del held[0][held[1]]
    return held[2]


# --- [joints]: a term names a channel or, if there is no such channel, another entry: `knuckle2` may follow
# `knuckle1`, like a mimic joint of a URDF. Schemas contain only channels, so such terms are replaced by
# those of the entry they name

DEPTH_MAX = 32  # length of a chain of joints that follow one another
TERMS_MAX = 1 << 16  # of all joints, once resolved to channels


class TermError(ValueError):
    """An invalid entry. `joint`: the entry's name; `term`: index of the wrong term, None for the whole
    entry."""

    def __init__(self, joint: str, term: int | None, reason: str) -> None:
        super().__init__(reason)
        self.joint = joint
        self.term = term
        self.reason = reason


def resolve_entries(entries: Mapping[str, JointMap], channels: Sequence[str]) -> dict[str, JointMap]:
    """Express every entry in terms of channels, keeping the order.

    Raises TermError for an unknown name, a cycle, two joints that use one channel, or entries beyond the
    bounds above.
    """
    known = frozenset(channels)
    owners: dict[str, str] = {}
    for joint, entry in entries.items():
        for i, (name, _) in enumerate(entry.terms):
            if name not in known and name not in entries:
                raise TermError(joint, i, f"unknown joint {name!r}")
        if len(entry.terms) == 1 and entry.terms[0][0] in known:
            channel = entry.terms[0][0]
            if channel in owners:
                reason = (
                    f"channel {channel!r} already moves joint {owners[channel]!r}; "
                    f"for a joint that moves with it, use {owners[channel]!r} as the term"
                )
                raise TermError(joint, 0, reason)
            owners[channel] = joint
    resolved: dict[str, JointMap] = {}
    terms = 0
    for joint in entries:
        terms += len(_resolve(joint, entries, known, resolved, ()).terms)
        if terms > TERMS_MAX:
            raise TermError(joint, None, f"all joints together have more than {TERMS_MAX} terms")
    return {joint: resolved[joint] for joint in entries}


def _resolve(
    joint: str,
    entries: Mapping[str, JointMap],
    channels: frozenset[str],
    resolved: dict[str, JointMap],
    above: tuple[str, ...],
) -> JointMap:
    if joint in resolved:
        return resolved[joint]
    if joint in above:
        loop = " → ".join((*above[above.index(joint) :], joint))
        raise TermError(joint, None, f"a loop: {loop}")
    if len(above) > DEPTH_MAX:
        raise TermError(above[0], None, f"a chain of more than {DEPTH_MAX} joints that follow one another")
    gains: dict[str, float] = {}
    offset = entries[joint].offset
    for name, gain in entries[joint].terms:
        if name in channels:
            gains[name] = gains.get(name, 0.0) + gain
            continue
        other = _resolve(name, entries, channels, resolved, (*above, joint))
        offset += gain * other.offset
        for channel, other_gain in other.terms:
            gains[channel] = gains.get(channel, 0.0) + gain * other_gain
    resolved[joint] = JointMap(tuple(gains.items()), offset)
    return resolved[joint]
