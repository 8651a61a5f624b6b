from __future__ import annotations

import math
from pathlib import Path

import pytest
from edge_stage import PROFILE
from posecast_edge.profile import ProfileError, load_profile, parse_profile
from posecast_wire.mapping import JointMap, SensorMount, Threshold

BASE = '[labels]\njoint=["A","B"]\n[[fields]]\nname="pos"\n'


def test_a_whole_profile() -> None:
    p = parse_profile(PROFILE)
    assert p.name == "two-joints"
    assert [(f.name, f.label_set, f.unit, f.scale, f.rel, f.bits) for f in p.fields] == [
        ("ref", "joint", "rad", 0.001, None, ()),
        ("pos", "joint", "rad", 0.001, "ref", ()),
        ("ftf", "ftf", "N", 1.0, None, ()),
        ("flags", "joint", "", 1.0, None, ("homed", "jam", "hot")),
    ]
    assert p.labels == {"joint": ("RKN", "LKN"), "ftf": ("RF.fz",)}
    m = p.mapping
    assert m.joints == {"KNEE": JointMap((("RKN", 2.0), ("LKN", -1.0)), math.pi / 2)}
    assert m.sensors == {"RF": SensorMount("wrench", "RF", "foot", (0.0, 0.0, -0.1), (0.0, 0.0, 0.0))}
    assert m.thresholds == {"ftf": {"RF.fz": Threshold(-30.0, 500.0, 0.5)}}
    assert m.severities == {"flags": {"homed": "state", "hot": "caution"}}
    assert m.tolerances == {"*": 0.05}
    assert m.names == {"RKN": "right knee", "RF": "right foot"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = ", "p.toml: Invalid value (at end of document)"),
        ("", "p.toml: fields: at least one [[fields]] is needed"),
        (BASE + "[robott]\n", "p.toml: robott: unknown key"),
        (BASE + "[robot]\nname='x'\ncolour='red'\n", "p.toml: robot.colour: unknown key; known: name, root"),
        (BASE + "unt='rad'\n", "p.toml: fields[0].unt: unknown key"),
        (BASE + "unit='furlong'\n", "p.toml: fields.pos.unit: unknown unit 'furlong'"),
        (BASE + "labels='joints'\n", "p.toml: fields.pos.labels: unknown label set 'joints'"),
        (BASE + "labels=['C','C']\n", "p.toml: fields.pos.labels[1]: 'C' stands there twice"),
        (BASE + "scale=0\n", "p.toml: fields.pos.scale: must be above 0, not 0"),
        (BASE + "scale='big'\n", "p.toml: fields.pos.scale: must be a number, not 'big'"),
        (BASE + "deadband=-1\n", "p.toml: fields.pos.deadband: must be at least 0, not -1"),
        (BASE + "rel='vel'\n", "p.toml: fields.pos.rel: 'vel' is no earlier field"),
        (BASE + "slow=1\n", "p.toml: fields.pos.slow: must be true or false, not 1"),
        (BASE + "[[fields]]\nname='pos'\n", "p.toml: fields[1].name: 'pos' stands there twice"),
        (BASE + "[[fields]]\nname='a b'\n", "p.toml: fields[1].name: 'a b' must be"),
        (BASE + "[joints.K]\nterms=[['C',1]]\n", "p.toml: joints.K.terms[0]: unknown joint 'C'"),
        (BASE + "[joints.K]\nterms=[['A']]\n", "p.toml: joints.K.terms[0]: must be [channel, gain]"),
        (BASE + "[joints.K]\nterms=[['A',nan]]\n", "p.toml: joints.K.terms[0]: must be a number"),
        (
            BASE + "[joints.A]\noffset_deg=1\noffset_rad=1\n",
            "p.toml: joints.A: give offset_rad or offset_deg",
        ),
        (BASE + "[sensors.RF]\nkind='nose'\n", "p.toml: sensors.RF.kind: unknown kind 'nose'"),
        (BASE + "[sensors.RF]\nkind='imu'\nxyz=[1,2]\n", "p.toml: sensors.RF.xyz: must be three numbers"),
        (BASE + "[severity.pos]\njam='fault'\n", "p.toml: severity.pos.jam: unknown bit 'jam'"),
        (BASE + "[thresholds.temp]\nA={high=1}\n", "p.toml: thresholds.temp: unknown field 'temp'"),
        (BASE + "[thresholds.pos]\nC={high=1}\n", "p.toml: thresholds.pos.C: unknown label 'C'"),
        (BASE + "[thresholds.pos]\nA={}\n", "p.toml: thresholds.pos.A: needs low or high"),
        (
            BASE + "[thresholds.pos]\nA={low=2,high=1}\n",
            "p.toml: thresholds.pos.A: low 2 is not below high 1",
        ),
        (BASE + "[tolerance]\nC=1\n", "p.toml: tolerance.C: unknown joint 'C'"),
        (BASE + "[names]\nC='c'\n", "p.toml: names.C: unknown channel or site 'C'"),
        (BASE + "[names]\nA=''\n", "p.toml: names.A: must be a text"),
        (BASE + "[trajectory]\ncolumns=['A']\n", "p.toml: trajectory.rate_hz: must be a number, not None"),
        (BASE + "[trajectory]\ncolumns=['C']\nrate_hz=1\n", "p.toml: trajectory.columns[0]: unknown"),
    ],
)
def test_a_mistake_is_named_with_file_and_place(text: str, message: str) -> None:
    with pytest.raises(ProfileError) as caught:
        parse_profile(text, "p.toml")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_or_not_text(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match="No such file"):
        load_profile(tmp_path / "x.toml")
    (tmp_path / "y.toml").write_bytes(b"a = '\xff'")
    with pytest.raises(ProfileError, match="not UTF-8"):
        load_profile(tmp_path / "y.toml")


def test_every_profile_in_the_package_parses_and_makes_a_schema() -> None:
    from posecast_edge.schema_build import schema_text
    from posecast_wire.schema import Schema

    files = sorted((Path(__file__).parents[1] / "src/posecast_edge/profiles").glob("*.toml"))
    assert files
    for file in files:
        assert Schema.parse(schema_text(load_profile(file))).size > 0
