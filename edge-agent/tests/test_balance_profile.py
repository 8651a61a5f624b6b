"""A profile's [balance] and the limits of its margin."""

from __future__ import annotations

import io
import re

import pytest
from model_stage import joint, link, robot
from posecast_edge.model.doctor.skeleton import examine_model
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.tree import build_tree
from posecast_edge.profile.reader import ProfileError, parse_profile
from posecast_edge.profile.schema import make_schema_text
from posecast_wire.schema import BalanceRule, Mapping, Schema, Threshold

SOLE = "[[0.1, 0.05, 0], [-0.1, 0.05, 0], [0, -0.05, 0]]"
SENSORS = """
[sensors]
RF = { kind = "wrench", link = "right_foot" }
LF = { kind = "wrench", link = "left_foot" }
RH = { kind = "wrench" }
torso = { kind = "imu", link = "body" }
"""
STANDING = f"""
[labels]
joint = ["A"]
[[fields]]
name = "pos"
[[fields]]
name = "ftf"
labels = ["RF.fz", "LF.fz"]
{SENSORS}
"""
ALL = f"""
[balance]
feet = ["RF", "LF"]
ground = "measured"
soles.RF = {SOLE}
[thresholds.balance]
margin = {{ low = 10, caution = 0.4 }}
"""
CORNERS = ((0.1, 0.05, 0.0), (-0.1, 0.05, 0.0), (0.0, -0.05, 0.0))


def test_it_comes_to_the_viewer_as_it_stands() -> None:
    mapping = Schema.parse(make_schema_text(parse_profile(STANDING + ALL))).mapping
    assert mapping.balance == BalanceRule(("RF", "LF"), "measured", {"RF": CORNERS})
    assert mapping.find_threshold("balance", "margin") == Threshold(10.0, None, 0.4)


def test_a_profile_that_says_nothing_says_nothing() -> None:
    text = make_schema_text(parse_profile(STANDING))
    assert '"balance"' not in text
    assert Schema.parse(text).mapping.balance == BalanceRule()
    assert parse_profile(STANDING + "[balance]\nfeet = []\n").mapping.balance.feet == ()


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('feet = ["RF", "gone"]\nground = "measured"', r"balance\.feet\[1\]: unknown site 'gone'"),
        ('feet = ["torso"]', r"balance\.feet\[0\]: 'torso' is a sensor of kind imu, not wrench"),
        ('feet = ["RH"]', r"balance\.feet\[0\]: sensor 'RH' has no link"),
        ('feet = ["RF", "RF"]', r"balance\.feet\[1\]: 'RF' is listed twice"),
        (
            'feet = ["LF", "left_foot", "RF"]',
            r"balance\.feet\[1\]: 'LF' and 'left_foot' are the same foot: both are on link 'left_foot'",
        ),
        ('feet = ["left_foot", "RF", "LF"]', r"balance\.feet\[2\]: 'left_foot' and 'LF' are the same foot"),
        ('feet = "RF"', r"balance\.feet: must be a list"),
        (f"feet = {[f'l{i}' for i in range(17)]}", r"balance\.feet: more than 16"),
        ('ground = "air"', r"balance\.ground: unknown ground 'air'"),
        ("toes = 1", r"balance\.toes: unknown key"),
        (f'feet = ["LF"]\nsoles.RF = {SOLE}', r"balance\.soles\.RF: 'RF' is not one of the feet"),
        ("soles.RF = [[0, 0, 0], [1, 0, 0]]", r"balance\.soles\.RF: must be a list of 3 to 64 corners"),
        ("soles.RF = [[0, 0, 0], [1, 0, 0], [1, inf, 0]]", r"balance\.soles\.RF\[2\]\[1\]: must be a number"),
        ("soles.RF = [[0, 0, 0], [1, 0], [1, 1, 0]]", r"balance\.soles\.RF\[1\]: must be three numbers"),
        ("soles.RF = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]", r"balance\.soles\.RF: .*under 1 cm²"),
        ("soles.RF = [[0, 0, 0], [1e30, 0, 0], [1, 1, 0]]", r"balance\.soles\.RF\[1\]: more than 10 m from"),
        ("soles.RF = [[0, 0, -10.1], [1, 0, 0], [1, 1, 0]]", r"balance\.soles\.RF\[0\]: more than 10 m from"),
        (f"soles = {{ {', '.join(f'l{i} = {SOLE}' for i in range(17))} }}", r"balance\.soles: more than 16"),
    ],
)
def test_a_mistake_is_one_line_with_file_and_place(table: str, words: str) -> None:
    with pytest.raises(ProfileError) as raised:
        parse_profile(f"{STANDING}\n[balance]\n{table}\n", "robot.toml")
    assert re.match(rf"robot\.toml:\d+: {words}", str(raised.value)), raised.value
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("[thresholds.balance]\nedge = { low = 1 }", r"thresholds\.balance\.edge: unknown label 'edge'"),
        (
            "[thresholds.balance]\nmargin = { caution = 1 }",
            r"thresholds\.balance\.margin: give low, high or both",
        ),
        ("[thresholds.gone]\nmargin = { low = 1 }", r"thresholds\.gone: unknown field 'gone'"),
    ],
)
def test_only_the_margin_has_limits_beside_the_fields(table: str, words: str) -> None:
    with pytest.raises(ProfileError, match=words):
        parse_profile(f"{STANDING}\n{table}\n")


VIEWS = """
[views.lab]
fields = ["pos", "ftf"]
[views.public]
fields = ["pos"]
[views.forces]
fields = ["ftf"]
"""


def see(name: str) -> Mapping:
    profile = parse_profile(STANDING + ALL + VIEWS)
    return Schema.parse(make_schema_text(profile.restrict_to_view(profile.views[name]))).mapping


def test_a_view_without_the_feets_forces_stands_on_their_links() -> None:
    assert see("lab").balance == BalanceRule(("RF", "LF"), "measured", {"RF": CORNERS})
    seen = see("public")
    assert seen.balance == BalanceRule(("right_foot", "left_foot"), "lowest", {"right_foot": CORNERS})
    assert seen.find_threshold("balance", "margin") is not None
    assert see("forces").balance == BalanceRule(), "nothing moves there"
    assert see("forces").find_threshold("balance", "margin") is None


def test_the_doctor_names_a_foot_that_the_model_has_not() -> None:
    urdf = read_urdf(io.BytesIO(robot(link("right_foot")).encode()))
    meaning = parse_profile(STANDING + '[balance]\nfeet = ["right_foot", "lost"]\n').mapping
    found = [f for f in examine_model(urdf, build_tree(urdf), None, meaning) if f.code == "profile-foot"]
    assert len(found) == 1
    assert "names foot 'lost', which is neither a sensor nor a link" in found[0].text


@pytest.mark.parametrize(
    ("turn", "tilt"), [(0.0, None), (0.9, None), (1.2, 69), (1.5708, 90), (3.1416, None)]
)
def test_the_doctor_names_a_sole_that_stands_upright(turn: float, tilt: int | None) -> None:
    """Its foot hangs turned, less by what the ankle's nearest limit turns it."""
    inside = f'<origin xyz="0 0 0" rpy="0 {turn - 0.1} 0"/><axis xyz="0 1 0"/>'
    ankle = joint("j", "body", "right_foot", inside=inside, limit='<limit lower="0.1" upper="1"/>')
    text = robot(link("body"), link("right_foot"), ankle)
    urdf = read_urdf(io.BytesIO(text.encode()))
    meaning = parse_profile(STANDING + ALL).mapping
    found = [f.text for f in examine_model(urdf, build_tree(urdf), None, meaning) if f.code == "profile-sole"]
    if tilt is None:
        assert found == []
    else:
        (said,) = found
        assert said.startswith(f"the profile's [balance] soles.'RF' is tilted by {tilt}° with all joints")
        assert said.endswith("the axes of link 'right_foot'")
