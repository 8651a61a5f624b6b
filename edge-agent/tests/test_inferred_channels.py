"""Without a profile, names become channels: those of the first sample, and later ones, within bounds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
from posecast_edge.pipeline.inferred_channels import (
    FIELDS_MAX,
    GROW_EVERY_S,
    GROWN_BYTES_MAX,
    GROWTHS_MAX,
    LEFT_OUT_MAX,
    NAMES_BYTES_MAX,
    REPORTS_MAX,
    TOO_LARGE,
    TOO_MUCH,
    TOO_OFTEN,
    WAITING_MAX,
    InferredChannels,
)
from posecast_edge.profile.defaults import FLAG_BITS
from posecast_edge.profile.schema import make_schema_text
from posecast_edge.sample import Sample
from posecast_wire.schema import CHANNELS_MAX, Schema

HALF = "\ud800"


class Stage:
    """The channels of one robot, and what was said about them."""

    def __init__(self, **first: Any) -> None:
        self.said: list[str] = []
        self.channels = InferredChannels("r1", self.said.append)
        if first:
            self.take(0.0, **first)

    def take(self, now_s: float, **values: Any) -> Mapping[str, Any]:
        return self.take_sample(Sample(now_s, values), now_s)

    def take_sample(self, sample: Sample, now_s: float) -> Mapping[str, Any]:
        return self.channels.take(sample, now_s).values

    @property
    def schema(self) -> Schema:
        assert self.channels.profile is not None
        return Schema.parse(make_schema_text(self.channels.profile))

    @property
    def labels(self) -> dict[str, tuple[str, ...]]:
        return {f.name: f.labels for f in self.schema.fields}


def test_a_field_and_a_joint_that_come_later_stand_behind_the_others() -> None:
    stage = Stage(pos={"b": 0.1}, effort={"a": 1.0})
    first = stage.channels.profile
    assert stage.labels == {"pos": ("b", "a"), "effort": ("b", "a")}
    stage.take(9.0, pos={"finger": 0.1, "b": 0.2}, gyro={"imu.x": 0.0})
    joints = ("b", "a", "finger")
    assert stage.labels == {"pos": joints, "effort": joints, "gyro": ("imu.x",)}
    grown = stage.channels.profile
    assert grown is not first
    stage.take(20.0, pos={"finger": 0.1})
    assert stage.channels.profile is grown, "what is known changes nothing"
    assert stage.said == []


def test_names_wait_for_others_and_are_not_forgotten() -> None:
    stage = Stage(pos={"a": 0.0})
    stage.take(0.1, temp={"a": 40.0})
    for n in range(1, 9):
        stage.take(n / 10, pos={"a": 0.0})
        assert set(stage.labels) == {"pos"}
    stage.take(0.5, volt={"main": 24.0})  # once
    stage.take(GROW_EVERY_S, pos={"a": 0.0})
    assert set(stage.labels) == {"pos", "temp", "volt"}
    stage.take(GROW_EVERY_S + 0.1, amp={"main": 1.0})
    assert "amp" not in stage.labels
    stage.channels.grow()
    assert "amp" in stage.labels


def test_a_late_fault_has_a_bit() -> None:
    stage = Stage(flags={"a": ["homed"], "b": []})
    stage.take(5.0, flags={"a": ["homed", "overheat"], "b": ["overheat"]})
    flags = stage.schema.find_field("flags")
    assert flags is not None
    assert flags.bits == (*FLAG_BITS, "homed", "overheat")
    own = [f"bit {n}" for n in range(30)]
    stage.take(9.0, flags={"a": own[:20]})
    flags = stage.schema.find_field("flags")
    assert flags is not None
    assert flags.bits == (*FLAG_BITS[:6], "homed", "overheat", *own[:20]), "what it never named makes room"
    stage.take(9.1, flags={"a": own})
    flags = stage.schema.find_field("flags")
    assert flags is not None
    assert flags.bits == ("homed", "overheat", *own[:26])
    assert stage.said == [
        f"the bit 'bit {n}' of flags is left out: a field has at most 28 bits" for n in range(26, 30)
    ]


def test_a_bit_does_not_wait_for_others() -> None:
    """A fault may last no longer than one sample."""
    stage = Stage(flags={"a": []})
    stage.take(0.01, flags={"a": ["odd"]})
    stage.take(0.02, flags={"a": ["even"]})
    flags = stage.schema.find_field("flags")
    assert flags is not None
    assert flags.bits == (*FLAG_BITS, "odd", "even")


def test_bits_that_have_no_place_are_named_once() -> None:
    stage = Stage(diag={"motor": ["warn"]}, flags={"a": (1 << 28) - 1})
    for n in range(9):
        stage.take(2.0 * n, diag={"motor": ["odd"]}, flags={"a": ["jam"]})
    assert stage.said == [
        "the bit 'odd' of diag is left out: the bits are warn, error, stale",
        "the bit 'jam' of flags is left out: a field has at most 28 bits",
    ]


MASK_NAMES = tuple(f"bit{n}" for n in range(28))


def bits_of(stage: Stage) -> tuple[str, ...]:
    flags = stage.schema.find_field("flags")
    assert flags is not None
    return flags.bits


@pytest.mark.parametrize("named", [[], ["jam"], ["odd"]])
def test_a_mask_never_gets_names_that_the_robot_gave_to_other_bits(named: list[str]) -> None:
    stage = Stage(pos={"a": 0.1}, flags={"a": named, "b": named})
    shown = stage.take(5.0, flags={"a": 5, "b": named})["flags"]
    if named:
        assert shown == {"a": ["bit0", "bit2"], "b": named}
        assert bits_of(stage) == (*FLAG_BITS, *(n for n in named if n == "odd"), "bit0", "bit2")
    else:
        assert (shown, bits_of(stage)) == ({"a": 5, "b": []}, MASK_NAMES)
    assert stage.said == []


def test_masks_of_zero_say_nothing_about_names() -> None:
    stage = Stage(flags={"a": 0, "b": 0})
    assert stage.take(5.0, flags={"a": ["jam", "odd"], "b": 0})["flags"] == {"a": ["jam", "odd"], "b": 0}
    assert bits_of(stage) == (*FLAG_BITS, "odd")
    assert stage.said == []


def test_masks_stay_masks_until_a_bit_has_a_name() -> None:
    stage = Stage(flags={"a": 5})
    assert stage.take(5.0, flags={"a": 5, "b": 1})["flags"] == {"a": 5, "b": 1}
    assert bits_of(stage) == MASK_NAMES
    assert stage.take(6.0, flags={"a": ["odd"], "b": 1})["flags"] == {"a": ["odd"], "b": ["bit0"]}
    assert bits_of(stage) == (*FLAG_BITS, "bit0", "bit2", "odd")
    assert stage.said == []


def test_a_list_of_masks_has_no_names_either() -> None:
    stage = Stage(pos={"a": 0.1, "b": 0.1}, flags=[0, 1])
    assert bits_of(stage) == MASK_NAMES
    assert stage.take(5.0, flags=[["odd"], 1])["flags"] == [["odd"], ["bit0"]]


BAD: list[tuple[dict[Any, Any], str]] = [
    ({"pos": {"": 1.0}}, "pos of '' is left out: a name has 1 to 200 characters, none of them a control"),
    ({"pos": {"elbow\t": 1.0}}, r"pos of 'elbow\t' is left out"),
    ({"pos": {"one\ntwo": 1.0}}, r"pos of 'one\ntwo' is left out"),
    ({"pos": {HALF: 1.0}}, r"pos of '\ud800' is left out"),
    ({"pos": {"x" * 201: 1.0}}, "pos of 'xxx"),
    ({"pos": {7: 1.0}}, "pos of 7 is left out"),
    ({"joint-temp": {"a": 40.0}}, "'joint-temp' is left out: a field's name has letters, digits and _"),
    ({"": {"a": 40.0}}, "'' is left out: a field's name"),
    ({HALF: {"a": 40.0}}, r"'\ud800' is left out: a field's name"),
    ({5: {"a": 40.0}}, "5 is left out: a field's name"),
    ({"x" * 64: {"a": 40.0}}, "is left out: a field's name"),
    ({"ee_pose": [0.1, 0.2, 0.3]}, "'ee_pose' is left out: it has 3 values without names; name them"),
    ({"cur": [0.1, 0.2, 0.3]}, "'cur' is left out: it has 3 values without names; name them"),
    ({"flags": {"a": ["jam", ""]}}, "the bit '' of flags is left out: a name has 1 to 200"),
]


@pytest.mark.parametrize(("bad", "line"), BAD, ids=[line[:20] for _, line in BAD])
@pytest.mark.parametrize("late", [False, True])
def test_one_name_that_is_none_costs_that_name_only(bad: dict[Any, Any], line: str, late: bool) -> None:
    good: dict[Any, Any] = {"pos": {"a": 0.1, "b": 0.2}, "volt": {"main": 24.0}}
    both = {**good, **bad}
    if "pos" in bad:
        both["pos"] = {**good["pos"], **bad["pos"]}
    stage = Stage(**(good if late else {}))
    for n in range(9):
        stage.take_sample(Sample(float(n), both, where="line 1"), 2.0 + n)
    labels = stage.labels
    labels.pop("flags", None)
    assert labels == {"pos": ("a", "b"), "volt": ("main",)}
    assert len(stage.said) == 1
    assert stage.said[0].startswith("line 1: ")
    assert line in stage.said[0]
    assert stage.said[0].isprintable()


def test_a_name_that_turns_the_line_is_a_name_and_is_shown_escaped() -> None:
    stage = Stage(pos={"\u202eelbow": 0.1}, **{"\u202etorque": {"a": 1.0}})
    assert stage.labels == {"pos": ("\u202eelbow",)}
    assert stage.said[0].startswith(r"'\u202etorque' is left out")


def test_what_names_nothing_is_no_robot_yet() -> None:
    stage = Stage(ee_pose=[1.0], pos={"": 1.0})
    assert stage.channels.profile is None
    stage.take(0.01, pos={"a": 0.0})
    assert stage.labels == {"pos": ("a",)}


def test_a_list_keeps_the_joints_that_it_began_with() -> None:
    stage = Stage(cur=[0.1, 0.2], pos={"a": 0.0, "b": 0.0})
    assert stage.labels == {"pos": ("a", "b"), "cur": ("a", "b")}
    late = {"pos": {"finger": 0.0, "a": 0.0, "b": 0.0}}
    assert stage.take(5.0, cur=[0.1, 0.2], **late)["cur"] == {"a": 0.1, "b": 0.2}
    assert stage.labels["cur"] == ("a", "b", "finger")
    assert stage.take(6.0, cur=[9.0, 0.1, 0.2], **late)["cur"] == {}, "nobody knows which is the finger's"
    assert stage.take(7.0, cur={"finger": 9.0}, **late)["cur"] == {"finger": 9.0}
    assert stage.said == ["cur is left out: it has 3 values without names; name them, or give a profile"]


def test_a_field_that_makes_up_names_for_ever_is_closed_and_the_others_are_not() -> None:
    stage = Stage(pos={"a": 0.0}, diag={"x": []})
    schemas = set()
    for n in range(200 * 10 * GROWTHS_MAX):  # at 200 Hz
        stage.take(n / 200, pos={"a": 0.0}, diag={f"cpu {n} %": []})
        schemas.add(id(stage.channels.profile))
    assert len(schemas) <= GROWTHS_MAX + 1
    assert 1 + GROWTHS_MAX <= len(stage.labels["diag"]) <= 1 + GROWTHS_MAX * (WAITING_MAX + 2)
    stage.take(1e4, pos={"a": 0.0, "finger": 0.0})
    assert stage.labels["pos"] == ("a", "finger")
    assert len(stage.said) == 1
    assert stage.said[0].startswith("diag of 'cpu ")
    assert stage.said[0].endswith(f" left out: {TOO_OFTEN}")


def test_fields_that_are_made_up_for_ever_end_and_joints_are_still_added() -> None:
    stage = Stage(pos={"a": 0.0})
    for n in range(20_000):
        stage.take(n / 10, **{f"f{n}": {"x": 1.0}})
    assert len(stage.labels) == FIELDS_MAX
    stage.take(1e4, pos={"a": 0.0, "finger": 0.0})
    assert stage.labels["pos"] == ("a", "finger")
    assert stage.said == [f"new fields are left out: a robot has at most {FIELDS_MAX}"]


def test_schemas_are_bounded_in_bytes() -> None:
    stage, sizes = Stage(pos={"a": 0.0}), list[int]()
    for n in range(200):
        labels = {f"{'x' * 90} {n} {k}": 0.0 for k in range(15)}
        stage.take(n * GROW_EVERY_S, **{f"f{n % 8}": labels})
        sizes.append(len(stage.schema.text))
    made = [size for size, before in zip(sizes[1:], sizes, strict=False) if size != before]
    assert sum(made) <= GROWN_BYTES_MAX + max(made)
    assert stage.said[0].endswith(TOO_MUCH)
    assert len(stage.said) == 1


def test_one_field_without_room_leaves_the_others() -> None:
    stage = Stage(pos={"a": 0.0})
    huge = {f"s{k}": 0.0 for k in range(CHANNELS_MAX)}
    for n in range(1, 5):
        stage.take(float(n), volt=huge, amp={"main": 1.0})
    fitting = tuple(huge)[: CHANNELS_MAX - 2]
    assert stage.labels == {"pos": ("a",), "amp": ("main",), "volt": fitting}
    assert stage.said == [f"volt of 's4094' and 1 more are left out: {TOO_LARGE}"]
    stage.take(9.0, volt={**huge, "main": 1.0})
    assert stage.labels["volt"] == fitting
    assert stage.said[1:] == [f"volt of 'main' is left out: {TOO_LARGE}"]


def test_of_a_first_sample_that_is_too_large_the_first_names_are_shown() -> None:
    stage = Stage(skin={f"s{k}": 0.0 for k in range(5000)}, pos={"a": 0.0})
    assert stage.labels == {"skin": tuple(f"s{k}" for k in range(CHANNELS_MAX - 1)), "pos": ("a",)}
    assert stage.said == [f"skin of 's4095' and 904 more are left out: {TOO_LARGE}"]


def test_names_that_come_later_and_are_too_many_leave_those_that_were_there() -> None:
    stage = Stage(pos={"shoulder": 0.0, "elbow": 0.0}, vel={"elbow": 0.0})
    many = {f"j{k}": 0.0 for k in range(5000)}
    stage.take(9.0, pos={**many, "elbow": 0.0})
    joints = ("shoulder", "elbow", *tuple(many)[: CHANNELS_MAX // 2 - 2])
    assert stage.labels == {"pos": joints, "vel": joints}
    assert stage.said == [f"pos of 'j2046' and 2953 more are left out: {TOO_LARGE}"]
    stage.take(20.0, pos={"elbow": 0.0}, temp={"elbow": 40.0})
    assert stage.said[1:] == [f"temp of 'elbow' is left out: {TOO_LARGE}"]


def test_long_names_fill_the_room_in_bytes() -> None:
    names = [f"{k:04}" * 40 for k in range(3000)]
    stage = Stage(skin=dict.fromkeys(names, 0.0))
    shown = stage.labels["skin"]
    assert shown == tuple(names[: len(shown)])
    assert 0 <= NAMES_BYTES_MAX - sum(len(name) + 3 for name in shown) < len(names[0]) + 3


def test_memory_and_lines_are_bounded_whatever_is_made_up() -> None:
    stage = Stage(pos={"a": 0.0})
    for n in range(300):
        fresh = {f"{n} {k}": 0.0 for k in range(CHANNELS_MAX)}
        stage.take(n * GROW_EVERY_S, **{f"f{n}": fresh, f"bad {n}": fresh}, pos={f"\t{n}": 0.0})
    channels = stage.channels
    assert len(channels._left_out) <= LEFT_OUT_MAX
    assert len(channels._closed) <= FIELDS_MAX + 1
    assert not channels._waiting
    assert len(stage.said) == REPORTS_MAX
    assert stage.said[-1].endswith("; further names are not reported")


def test_sensors_and_sliding_joints_of_later_samples_count() -> None:
    stage = Stage(pos={"a": 0.0})
    values = {"pos": {"rail": 0.0}, "acc": {"torso.x": 0.0}}
    links = {"torso": "torso_link", "bad": "x\n"}
    stage.take_sample(Sample(2.0, values, links=links, sliding=frozenset({"rail"})), 2.0)
    mapping = stage.schema.mapping
    assert mapping.sensors["torso"].link == "torso_link"
    assert mapping.units == {"pos": {"rail": "m"}}
    stage.channels.sliding = frozenset({"a"})
    stage.take(2.1, pos={"a": 0.0})
    pos = stage.schema.find_field("pos")
    assert pos is not None
    assert pos.unit == "m", "the model's joints count at once"
