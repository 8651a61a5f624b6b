"""Balance of a robot that is known by heart. Each value that is none has a test, too."""

from __future__ import annotations

import json
import math
import random
import re
from typing import Any

import pytest
from posecast_relay.balance import course
from posecast_relay.balance.balance import make_balance_document
from posecast_relay.balance.foot_pose import FootPose, pose_foot
from posecast_relay.balance.model import read_balance_model
from posecast_relay.balance.polygon import find_hull, find_nearest_edge
from posecast_relay.balance.sole import compute_pressure, make_sole_plane
from posecast_relay.export.balance_columns import write_balance
from posecast_relay.kinematics.manifest_values import ModelTreeError

from .balance_stage import SENSORS, SOLE, WEIGHT_N, Standing, make_manifest, make_model, make_schema_text

NO_SENSORS: dict[str, Any] = {}
TRUNK: dict[str, Any] = make_manifest()["inertials"][0]
ONE = {"RF": SENSORS["RF"]}


def test_it_stands_in_the_middle_of_its_feet() -> None:
    found = Standing().read()
    assert found.mass_kg == 40
    assert found.centre_of_mass == pytest.approx((0.02, 0, 1.0))
    assert found.ground == "measured"
    assert found.floor_m == pytest.approx(0)
    assert [each for corner in found.polygon for each in corner] == pytest.approx(
        [-0.08, -0.15, 0.12, -0.15, 0.12, 0.15, -0.08, 0.15]
    )
    assert found.nearest_edge == 1
    assert found.margin_m == pytest.approx(0.1)
    assert found.pressure == pytest.approx((0, 0, 0))
    assert [(foot.name, foot.link, foot.bears) for foot in found.feet] == [
        ("RF", "right_sole", True),
        ("LF", "left_foot", True),
    ]
    assert found.feet[0].force_n == pytest.approx(WEIGHT_N / 2, abs=1e-3)
    assert found.feet[0].pressure == pytest.approx((0, -0.1, 0))
    assert not found.feet[0].at_edge


def test_a_floor_at_zero_has_no_minus(monkeypatch: pytest.MonkeyPatch) -> None:
    def pose_at_minus_zero(*args: Any) -> FootPose:
        return pose_foot(*args)._replace(lowest_m=-0.0)

    monkeypatch.setattr(course, "pose_foot", pose_at_minus_zero)
    floor_m = Standing().read().floor_m
    assert floor_m is not None
    assert math.copysign(1, floor_m) == 1


def test_a_document_has_no_minus_before_a_zero() -> None:
    """Of a floor 0.03 mm under the origin, and a centre of mass 0.03 mm outside."""
    low = [[x, y, -0.00003] for x, y, _ in SOLE]
    aside = {"link": 0, "mass_kg": 40, "xyz": [0.12003, -0.00003, 0.1], "inertia": [1, 0, 0, 1, 0, 1]}
    model = make_model(inertials=[aside], soles=[{"link": 2, "points": low}, {"link": 3, "points": low}])
    balance = Standing(model=model).read()
    assert balance.floor_m == pytest.approx(-0.00003)
    assert balance.margin_m == pytest.approx(-0.00003)
    document = make_balance_document(balance)
    assert (document["floor_m"], document["margin_mm"]) == (0, 0)
    assert "-0.0," not in json.dumps(document)
    assert not any(re.fullmatch(r"-[0.]+", cell) for cell in write_balance(balance))


def test_the_centre_outside_of_what_it_stands_on_has_a_margin_below_zero() -> None:
    found = Standing().read(LF_fz=0.0)
    assert [foot.bears for foot in found.feet] == [True, False]
    assert found.margin_m == pytest.approx(-0.05)
    assert found.pressure == pytest.approx((0, -0.1, 0))
    assert found.feet[1].pressure is None


@pytest.mark.parametrize("sign", [1, -1])
def test_a_foots_pressure_is_vukobratovics_whichever_way_the_force_is_told(sign: int) -> None:
    f, m, h = (12.0, -7.0, 200.0), (6.0, -9.0, 3.0), 0.1  # the right sensor stands so high above its sole
    names = ("fx", "fy", "fz", "mx", "my", "mz")
    values = {f"RF_{name}": sign * v for name, v in zip(names, (*f, *m), strict=True)}
    # the sensor's own xyz lifts it by 0.1 m once more
    h += 0.1
    x, y = (-m[1] - f[0] * h) / f[2], (m[0] - f[1] * h) / f[2]
    found = Standing().read(LF_fz=0.0, **values).feet[0]
    assert found.pressure == pytest.approx((x, -0.1 + y, 0), abs=1e-6)
    assert found.force_n == pytest.approx(200)


def test_a_pressure_at_the_edge_says_so() -> None:
    for x, wanted in ((0.114, False), (0.116, True), (0.13, True), (-0.076, True)):
        found = Standing().read(RF_my=-x * WEIGHT_N / 2)
        assert found.feet[0].pressure == pytest.approx((x, -0.1, 0), abs=1e-5)
        assert found.feet[0].at_edge == wanted, x


def test_the_wrench_may_be_told_in_any_unit_of_force() -> None:
    found = Standing(make_schema_text(unit="kN")).read(RF_fz=0.3, LF_fz=0.1)
    assert [foot.force_n for foot in found.feet] == pytest.approx([300, 100])
    assert found.pressure == pytest.approx((0, -0.05, 0))
    unknown = Standing(make_schema_text(unit="counts")).read()
    assert unknown.ground == "lowest", "nobody knows what a count is"


def test_a_foot_begins_to_bear_at_five_parts_of_a_hundred_and_ends_at_three() -> None:
    robot, bears = Standing(), []
    for i, part in enumerate((0.04, 0.06, 0.04, 0.02, 0.04)):
        bears.append(robot.read(i / 30, RF_fz=part * WEIGHT_N).feet[0].bears)
    assert bears == [False, True, True, False, False]
    assert robot.read(9.0, RF_fz=0.06 * WEIGHT_N).feet[0].bears
    assert not robot.read(10.0, RF_fz=0.04 * WEIGHT_N).feet[0].bears, "after a gap it begins anew"


def test_a_link_may_weigh_next_to_nothing_where_the_robot_does_not() -> None:
    light = {**TRUNK, "link": 1, "mass_kg": 1e-9}
    assert Standing(model=make_model(inertials=[TRUNK, light])).read().mass_kg == pytest.approx(40)


def test_without_masses_twenty_newtons_bear() -> None:
    for newtons, wanted in ((19.0, False), (21.0, True)):
        found = Standing(model=make_model(inertials=[])).read(RF_fz=newtons)
        assert found.feet[0].bears == wanted
        assert found.centre_of_mass is None
        assert found.margin_m is None
        assert found.mass_kg == 0
        assert len(found.polygon) == 4


def test_velocity_is_that_against_a_foot_that_stands_whatever_odometry_says() -> None:
    robot = Standing()
    first = robot.read(0.0)
    assert (first.velocity, first.capture_point, first.gaps.capture_point) == (None, None, "first-pose")
    for i in range(1, 31):  # the base drifts, and the legs lengthen by 0.3 m/s
        found = robot.read(i / 30, base_x=i / 30, right_leg=-0.01 * i, left_leg=-0.01 * i)
    assert found.velocity == pytest.approx((0, 0, 0.3), abs=1e-6)
    assert found.capture_point is not None
    assert found.centre_of_mass is not None
    assert found.capture_point[:2] == pytest.approx(found.centre_of_mass[:2])


def test_the_capture_point_is_ahead_by_the_root_of_height_by_gravity() -> None:
    tilted = {"link": 0, "mass_kg": 40, "xyz": [0, 0, 0.1], "inertia": [1, 0, 0, 1, 0, 1]}
    joints = make_manifest()["joints"]
    for joint in joints:
        joint["axis"] = [1, 0, 0]  # legs that slide forwards
    robot = Standing(model=make_model(inertials=[tilted], joints=joints))
    robot.read(0.0)
    found = robot.read(0.1, right_leg=-0.02, left_leg=-0.02)
    assert found.velocity == pytest.approx((0.2, 0, 0), abs=1e-9)
    assert found.capture_point == pytest.approx((0.2 * math.sqrt(1.0 / 9.81), 0, 0), abs=1e-9)
    slower = robot.read(0.2, right_leg=-0.02, left_leg=-0.02)
    assert slower.velocity == pytest.approx((0.2 * math.exp(-1), 0, 0), abs=1e-9)


@pytest.mark.parametrize("step_s", [0.8, -0.1])
def test_velocity_begins_anew_after_a_gap_and_when_time_runs_back(step_s: float) -> None:
    robot = Standing()
    robot.read(1.0)
    assert robot.read(1.1).velocity == pytest.approx((0, 0, 0))
    assert robot.read(1.1 + step_s, right_leg=0.1).velocity is None


def test_a_robot_that_stands_still_has_a_capture_point_by_two_frames_a_second() -> None:
    """The edge sends the frame of a robot that does not change at its first sample after 0.5 s."""
    robot = Standing()
    told = [robot.read(t_s).capture_point for t_s in (0.0, 0.533, 1.066, 1.666)]
    assert told[0] is None
    assert told[1:] == [pytest.approx((0.02, 0, 0))] * 3


def test_velocity_begins_anew_where_no_foot_bears_in_both_poses() -> None:
    robot = Standing()
    robot.read(0.0, LF_fz=0.0)
    assert robot.read(0.1, RF_fz=0.0).velocity is None
    assert robot.read(0.2, RF_fz=0.0).velocity is not None


@pytest.mark.parametrize(
    ("changes", "gap"),
    [
        ({"inertials": []}, "no-masses"),
        ({"inertials": None}, "old-bundle"),
        ({"inertials": [], "findings": [{"code": "mass-negative"}]}, "impossible-masses"),
        ({"inertials": [], "findings": [{"code": "inertia-triangle"}]}, "impossible-masses"),
        ({"inertials": [], "findings": [{"code": "mesh-missing"}, 5]}, "no-masses"),
        ({"inertials": [{**TRUNK, "mass_kg": 1e-300}]}, "impossible-masses"),
        (
            {"inertials": [{**TRUNK, "mass_kg": 5e-4}, {**TRUNK, "link": 1, "mass_kg": 4e-4}]},
            "impossible-masses",
        ),
        ({"inertials": [{**TRUNK, "xyz": [0, 0, -200]}]}, "impossible-masses"),
    ],
)
def test_no_masses_no_ball(changes: dict[str, Any], gap: str) -> None:
    found = Standing(model=make_model(**changes)).read()
    assert (found.centre_of_mass, found.velocity, found.capture_point, found.margin_m) == (None,) * 4
    gaps = found.gaps
    assert (gaps.centre_of_mass, gaps.margin, gaps.capture_point) == (gap, gap, gap)
    assert (gaps.polygon, gaps.pressure) == (None, None)
    assert len(found.polygon) == 4


@pytest.mark.parametrize(("soles", "gap"), [([], "no-feet"), (None, "old-bundle")])
def test_no_soles_no_polygon(soles: Any, gap: str) -> None:
    found = Standing(model=make_model(soles=soles)).read()
    assert (found.polygon, found.floor_m, found.ground, found.feet, found.pressure) == (
        (),
        None,
        None,
        (),
        None,
    )
    assert found.margin_m is None
    assert found.centre_of_mass is not None
    gaps = found.gaps
    assert {gaps.polygon, gaps.margin, gaps.pressure, gaps.capture_point} == {gap}


def test_no_wrench_no_pressure_and_the_lowest_soles_are_assumed_to_bear() -> None:
    text = make_schema_text(sensors=NO_SENSORS)
    found = Standing(text).read()
    assert found.ground == "lowest"
    assert [(foot.name, foot.bears, foot.force_n) for foot in found.feet] == [
        ("right_sole", True, None),
        ("left_foot", True, None),
    ]
    assert (found.pressure, found.gaps.pressure) == (None, "no-wrench")
    assert found.margin_m == pytest.approx(0.1)
    lifted = Standing(text).read(left_leg=0.011)
    assert [foot.bears for foot in lifted.feet] == [True, False]
    assert [foot.bears for foot in Standing(text).read(left_leg=0.009).feet] == [True, True]


def test_one_sensor_on_a_sole_leaves_the_lowest_of_all_soles() -> None:
    found = Standing(make_schema_text(sensors=ONE)).read()
    assert (len(found.feet), found.ground, found.gaps.pressure) == (2, "lowest", "no-wrench")


def test_a_foot_without_a_reading_leaves_no_polygon() -> None:
    losses: list[dict[str, Any]] = [{"RF_fz": None}, {"RF_fx": None}]
    for lost in losses:
        found = Standing().read(**lost)
        assert (found.polygon, found.floor_m, found.pressure, found.margin_m) == ((), None, None, None)
        assert [foot.bears for foot in found.feet] == [None, True]
        assert (found.feet[0].force_n, found.feet[0].pressure) == (None, None)
        assert (found.gaps.polygon, found.gaps.margin, found.gaps.pressure) == ("unread",) * 3
        assert found.centre_of_mass is not None
    found = Standing().read(RF_my=None)
    assert len(found.polygon) == 4
    assert (found.pressure, found.gaps.pressure) == (None, "unread")


def test_a_robot_in_the_air_has_no_floor() -> None:
    found = Standing().read(RF_fz=0.0, LF_fz=0.0)
    assert (found.polygon, found.floor_m, found.margin_m, found.pressure) == ((), None, None, None)
    assert (found.gaps.polygon, found.gaps.margin, found.gaps.pressure) == ("airborne",) * 3


def test_a_sensor_that_measures_forces_alone_tells_who_bears_and_no_pressure() -> None:
    found = Standing(make_schema_text(fields=("pos", "ftf", "base", "baseq"))).read()
    assert found.ground == "measured"
    assert len(found.polygon) == 4
    assert (found.pressure, found.gaps.pressure) == (None, "no-wrench")
    moments = Standing(make_schema_text(fields=("pos", "ftm", "base", "baseq"))).read()
    assert moments.ground == "lowest"
    asked = {"ground": "measured"}
    without = Standing(make_schema_text(asked, fields=("pos", "ftm", "base", "baseq"))).read()
    assert (without.polygon, without.gaps.polygon) == ((), "no-wrench")


@pytest.mark.parametrize(
    ("rule", "feet", "ground"),
    [
        ({"feet": []}, [], None),
        ({"feet": ["RF"]}, ["RF"], "measured"),
        ({"feet": ["LF", "RF"]}, ["LF", "RF"], "measured"),
        ({"feet": ["left_foot", "right_foot"]}, ["left_foot", "right_foot"], "measured"),
        ({"feet": ["RF", "LF"], "ground": "lowest"}, ["RF", "LF"], "lowest"),
        ({"feet": ["RF", "tail"]}, [], None),
        ({"feet": ["RF", "tail"], "ground": "lowest"}, ["RF"], "lowest"),
        ({"feet": ["LF", "left_foot", "RF"]}, [], None),
        ({"feet": ["LF", "left_foot", "RF"], "ground": "lowest"}, ["LF", "RF"], "lowest"),
        ({"feet": ["RF", "right_sole"], "soles": {"RF": SOLE, "right_sole": SOLE}}, [], None),
        ({"feet": ["trunk"]}, [], None),
        ({"feet": ["trunk"], "soles": {"trunk": SOLE}}, ["trunk"], "lowest"),
        ({"feet": ["trunk"], "soles": {"trunk": [[0, 0, 0], [1, 0, 0], [2, 0, 0]]}}, [], None),
        ({"ground": "lowest"}, ["RF", "LF"], "lowest"),
    ],
)
def test_the_profile_says_what_it_stands_on(
    rule: dict[str, Any], feet: list[str], ground: str | None
) -> None:
    found = Standing(make_schema_text(rule)).read()
    assert [foot.name for foot in found.feet] == feet
    assert found.ground == ground


def test_the_profiles_sole_is_in_the_foots_link() -> None:
    low = [[x, y, -0.02] for x, y, _ in SOLE]
    found = Standing(make_schema_text({"feet": ["RF", "LF"], "soles": {"RF": low}})).read(LF_fz=0.0)
    assert found.feet[0].link == "right_foot"
    assert found.floor_m == pytest.approx(0.08)


def test_whatever_numbers_a_robot_wrote_balance_is_none_or_finite() -> None:
    dice = random.Random("numbers")
    extremes = (5e-324, 1e-300, 1e308, -1e308, 1e155, 0.0)
    for _ in range(200):
        masses = [
            {
                "link": 0,
                "mass_kg": abs(dice.choice(extremes)) or 1,
                "xyz": dice.choices(extremes, k=3),
                "inertia": [0] * 6,
            }
        ]
        soles = [{"link": link, "points": [dice.choices(extremes, k=3) for _ in range(3)]} for link in (2, 3)]
        found = Standing(model=make_model(inertials=masses, soles=soles)).read()
        numbers = [*(found.centre_of_mass or ()), *(found.pressure or ()), found.margin_m or 0.0]
        assert all(math.isfinite(each) for each in [*numbers, found.floor_m or 0.0])


def test_a_hull_has_the_corners_alone() -> None:
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    assert find_hull([*square, (0.5, 0.5), (0.5, 0.0), (1.0, 1.0)]) == square
    assert find_hull([(0.0, 0.0), (2.0, 2.0), (1.0, 1.0)]) == [(0.0, 0.0), (2.0, 2.0)]
    assert find_hull([(1.0, 1.0), (1.0, 1.0)]) == [(1.0, 1.0)]
    assert find_hull([]) == []
    dice = random.Random("hull")
    points = [(dice.gauss(0, 1), dice.gauss(0, 1)) for _ in range(200)]
    hull = find_hull(points)
    for i, (ax, ay) in enumerate(hull):
        bx, by = hull[(i + 1) % len(hull)]
        assert all((bx - ax) * (y - ay) - (by - ay) * (x - ax) >= -1e-12 for x, y in points)


def test_the_nearest_edge_of_a_polygon() -> None:
    square = find_hull([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    assert find_nearest_edge(square, (0.9, 0.5)) == pytest.approx((1, 0.1))
    assert find_nearest_edge(square, (2.0, 2.0)) == pytest.approx((1, -math.sqrt(2)))
    assert find_nearest_edge(square, (0.5, 0.0)) == pytest.approx((0, 0.0))
    assert find_nearest_edge([(0.0, 0.0), (1.0, 0.0)], (0.5, 0.5)) == pytest.approx((0, -0.5))
    assert find_nearest_edge([], (0.0, 0.0)) is None


def test_a_sole_is_a_plane_whatever_the_order_of_its_corners() -> None:
    plane = make_sole_plane([(0, 0, 1), (1, 1, 1), (1, 0, 1), (0, 1, 1)], (0, 0, 3))
    assert plane is not None
    assert len(plane.corners) == 4
    assert plane.normal == pytest.approx((0, 0, 1))
    below = make_sole_plane([(0, 0, 1), (1, 1, 1), (1, 0, 1), (0, 1, 1)], (0, 0, -3))
    assert below is not None
    assert below.normal == pytest.approx((0, 0, -1))
    assert plane.centre == pytest.approx((0.5, 0.5, 1))
    assert make_sole_plane([(0, 0, 0), (1, 1, 1), (2, 2, 2)], (0, 0, 1)) is None
    assert make_sole_plane([(0, 0, 0), (0, 0, 0), (0, 0, 0)], (0, 0, 1)) is None
    assert make_sole_plane([(0, 0, 0), (1, 0, 0)], (0, 0, 1)) is None


def test_no_force_along_the_normal_no_pressure() -> None:
    assert compute_pressure((1, 0, 0), (0, 0, 0), (0, 0, 1), (0, 0, 1), (0, 0, 0)) is None


def broken(member: str, i: int, **changes: Any) -> bytes:
    """A manifest whose entry i of this member has other values."""
    manifest = make_manifest()
    manifest[member][i] |= changes
    return json.dumps(manifest).encode()


@pytest.mark.parametrize(
    ("manifest", "why"),
    [
        (json.dumps(make_manifest(inertials=5)).encode(), "inertials: no list"),
        (json.dumps(make_manifest(inertials=[{}] * 5)).encode(), "inertials: 5 are too many"),
        (json.dumps(make_manifest(inertials=[7])).encode(), "inertials[0]: no object"),
        (broken("inertials", 0, link=4), "inertials[0]: its link is not there"),
        (broken("inertials", 0, link=True), "inertials[0]: its link is not there"),
        (broken("inertials", 0, mass_kg=0), "inertials[0].mass_kg: no number above 0"),
        (broken("inertials", 0, mass_kg="5"), "inertials[0].mass_kg: no number"),
        (broken("inertials", 0, xyz=[0, 1]), "inertials[0].xyz: not 3 numbers"),
        (broken("inertials", 0, inertia=[1, 1, 1]), "inertials[0].inertia: not 6 numbers"),
        (broken("soles", 1, link=2), "soles[1]: its link does not come after the one before"),
        (json.dumps(make_manifest(soles=[{}] * 65)).encode(), "soles: 65 are too many"),
        (broken("soles", 0, points=SOLE[:2]), "soles[0].points: fewer than 3"),
        (broken("soles", 0, points=SOLE * 5), "soles[0].points: 20 are too many"),
        (broken("soles", 0, points=[[0, 0, None]] * 3), "soles[0].points[0]: no number"),
    ],
)
def test_masses_and_soles_that_cant_be_read_are_left_out_and_told_in_one_line(
    manifest: bytes, why: str
) -> None:
    model = read_balance_model(manifest)
    assert model.why == why
    assert (model.inertials is None) == why.startswith("inertials")
    assert (model.soles is None) == why.startswith("soles")
    assert len(model.tree.links) == 4


def test_a_manifest_that_poses_nothing_has_no_balance() -> None:
    with pytest.raises(ModelTreeError, match=r"^v: a URDF that has not been built; "):
        read_balance_model(b'{"v": 1}')
