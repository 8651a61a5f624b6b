from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import pytest
from cost_stage import cost, grows_linearly
from edge_stage import PROFILE
from posecast_edge.pipeline.stream import Stream
from posecast_edge.profile.defaults import FLAG_BITS
from posecast_edge.profile.reader import parse_profile
from posecast_edge.profile.schema import infer_profile, make_schema_text, mark_sliding
from posecast_edge.sample import Sample, SourceError, Values
from posecast_wire.decoder import Decoder
from posecast_wire.schema import Schema


def test_a_profile_survives_the_wire() -> None:
    profile = parse_profile(PROFILE)
    schema = Schema.parse(make_schema_text(profile))
    assert schema.robot == "two-joints"
    assert schema.mapping == profile.mapping
    assert [(f.name, f.labels, f.unit, f.scale, f.rel, f.bits) for f in schema.fields] == [
        (f.name, f.labels, f.unit, f.scale, f.rel, f.bits) for f in profile.fields
    ]


def of(**values: Values) -> Schema:
    return Schema.parse(make_schema_text(infer_profile("r1", Sample(0.0, values))))


def test_the_first_sample_names_the_channels() -> None:
    schema = of(
        pos={"A": 0.1, "B": 0.2},
        ref={"A": 0.1},
        cur=[1.0, 2.0],
        flags={"A": ["odd", "homed"]},
        ftf={"RF.fz": 1.0},
        gyro={"t.x": 0.0, "t.y": 0.0},
        acc={"t.x": 0.0, "t.y": 0.0},
        wind={"n": 1.0},
    )
    assert [(f.name, f.label_set, f.labels, f.unit) for f in schema.fields] == [
        ("ref", "joint", ("A", "B"), "rad"),
        ("pos", "joint", ("A", "B"), "rad"),
        ("cur", "joint", ("A", "B"), "A"),
        ("flags", "joint", ("A", "B"), ""),
        ("ftf", "ftf", ("RF.fz",), "N"),
        ("gyro", "gyro", ("t.x", "t.y"), "rad/s"),
        ("acc", "gyro", ("t.x", "t.y"), "m/s²"),
        ("wind", "wind", ("n",), ""),
    ]
    pos, flags = schema.find_field("pos"), schema.find_field("flags")
    assert pos is not None
    assert pos.rel == "ref"
    assert flags is not None
    assert flags.bits == (*FLAG_BITS, "odd", "homed")
    assert schema.mapping.find_severity("flags", "homed") == "state"
    assert schema.mapping.find_severity("flags", "odd") == "fault"


def test_a_state_that_no_flag_names_is_not_declared() -> None:
    """A page would say of every joint that it isn't homed and is switched off."""
    flags = of(flags={"A": ["jam"], "B": []}).find_field("flags")
    assert flags is not None
    assert "jam" in flags.bits
    assert not {"homed", "enabled"} & set(flags.bits)


def test_masks_have_bits_without_names() -> None:
    flags = of(flags={"A": 5}).find_field("flags")
    assert flags is not None
    assert flags.bits[:2] == ("bit0", "bit1")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"pos": [1.0, 2.0]}, "it names no channel"),
        ({"ftf": [1.0]}, "it names no channel"),
        ({}, "it names no channel"),
    ],
)
def test_what_a_sample_cannot_say(values: dict[str, Values], message: str) -> None:
    with pytest.raises(SourceError) as caught:
        infer_profile("r1", Sample(0.0, values))
    assert str(caught.value).startswith(message)


FIRST: dict[str, Callable[[int], Mapping[str, Values]]] = {
    "channels": lambda n: {"pos": {f"j{i}": 0.1 for i in range(n)}},
    "fields": lambda n: {f"f{i}": {f"c{i}": 0.1} for i in range(n)},
    "fields of the same channel": lambda n: {f"f{i}": {"c": 0.1} for i in range(n)},
    "fields without channels": lambda n: {f"f{i}": {} for i in range(n)} | {"pos": {"A": 1.0}},
    "bits": lambda n: {"flags": {f"j{i}": ["jam", f"b{i}"] for i in range(n)}},
}


@pytest.mark.parametrize("kind", FIRST)
def test_a_first_sample_costs_what_it_is_long(kind: str) -> None:
    """All the way to its events and frame."""

    def steps(n: int) -> int:
        sample = Sample(0.0, FIRST[kind](n))

        def show() -> None:
            stream = Stream(infer_profile("r", sample), 4.0, lambda line: None)
            stream.deliver(sample, 0.0)
            assert stream.tick(0.0) is not None

        show()  # codes that are kept count once
        return cost(show)

    assert grows_linearly(steps, 200)


def test_joints_that_slide_are_metres_in_tenths_of_a_millimetre() -> None:
    values: dict[str, Values] = {name: {"A": 0.1, "F": 0.02} for name in ("pos", "vel", "effort", "cur")}
    bare = Schema.parse(make_schema_text(infer_profile("r", Sample(0.0, values))))
    assert bare.mapping.units == {}
    profile = infer_profile("r", Sample(0.0, values), ["F", "no such joint"])
    assert profile == infer_profile("r", Sample(0.0, values, sliding=frozenset({"F"})))
    assert mark_sliding(profile, {"F"}) == profile
    schema = Schema.parse(make_schema_text(profile))
    assert schema.mapping.units == {"pos": {"F": "m"}, "vel": {"F": "m/s"}, "effort": {"F": "N"}}
    assert [(f.name, f.labels, f.unit, f.scale) for f in schema.fields] == [
        ("pos", ("A", "F"), "rad", 0.0001),
        ("vel", ("A", "F"), "rad/s", 0.005),
        ("effort", ("A", "F"), "N·m", 0.05),
        ("cur", ("A", "F"), "A", 0.01),
    ]
    stream = Stream(profile, 4.0, lambda line: None)
    sample = Sample(0.0, {"pos": {"A": 0.12345, "F": 0.02346}})
    stream.deliver(sample, 0.0)
    frame = stream.tick(0.0)
    assert frame is not None
    decoder = Decoder()
    decoder.add_schema(stream.schema.text)
    assert decoder.decode(frame.data).values("pos") == [pytest.approx(0.123), pytest.approx(0.0235)]


def test_a_robot_that_only_slides_has_no_angles() -> None:
    profile = infer_profile("r", Sample(0.0, {"pos": {"x": 0.1, "y": 0.2}}), {"x", "y"})
    assert [(f.unit, f.scale, f.strides) for f in profile.fields] == [("m", 0.0001, {})]
    assert profile.mapping.units == {}


def mean_frame_bytes(sliding: int) -> float:
    """Mean bytes of a frame that is no KEY: 100 joints swing at 30 Hz by 0.1 rad (those that slide by 0.1 m),
    each at its own rate; what a ROS JointState has of them moves."""
    names = [f"joint_{i}" for i in range(100)]
    rates = [1.0 + 0.05 * i for i in range(100)]  # rad/s of the swing

    def swing(most: Sequence[float], t_s: float, ahead: float) -> dict[str, float]:
        return {
            name: a * math.sin(w * (t_s + 7.0) + ahead) for name, a, w in zip(names, most, rates, strict=True)
        }

    def sample(t_s: float) -> Sample:
        values: dict[str, Values] = {
            "pos": swing([0.1] * 100, t_s, 0.0),
            "vel": swing([0.1 * w for w in rates], t_s, math.pi / 2),
            "effort": swing([10.0] * 100, t_s, 1.0),
        }
        return Sample(t_s, values, sliding=frozenset(names[:sliding]))

    stream = Stream(infer_profile("r", sample(0.0)), 4.0, lambda line: None)
    sizes = []
    for i in range(240):
        stream.deliver(sample(i / 30), i / 30)
        frame = stream.tick(i / 30)
        assert frame is not None
        sizes.append(len(frame.data))
    return sum(sizes[121:]) / 119  # after the second KEY, which knows how far channels move


def test_a_joint_that_slides_costs_what_its_finer_steps_cost_all_joints() -> None:
    turning, one, half, all_slide = map(mean_frame_bytes, (0, 1, 50, 100))
    assert turning <= 345.5
    # log2(10) bits of each position and one of each velocity; more sliding joints cost nothing more
    assert 50 < one - turning < 58
    assert half <= one + 5
    assert all_slide <= one + 5
