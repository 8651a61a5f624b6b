"""The daemon's frames, filled as C would and read back."""

from __future__ import annotations

import ctypes
import random
from pathlib import Path
from typing import Any

import pytest
from hubo_structs import NAMES, SLOT, STATUS_BYTES, VERSIONS, state
from posecast_edge.pipeline.stream import Stream
from posecast_edge.profile.reader import load_profile
from posecast_edge.sample import Sample
from posecast_edge.sources.hubo.state import BITS, HuboDecoder, UnknownFrame
from posecast_wire.decoder import Decoder as WireDecoder

PROFILES = Path(__file__).parents[1] / "src/posecast_edge/profiles"


def by_name(whole: Any) -> tuple[float, dict[str, Any]]:
    t_s, values = HuboDecoder(None).decode(bytes(whole))
    return t_s, dict(values)


def filled(size: int) -> Any:
    """A number of its own in every member."""
    s = state(**VERSIONS[size])
    for i in range(3):
        for k, name in enumerate(("a_x", "a_y", "a_z", "w_x", "w_y", "w_z")):
            setattr(s.imu[i], name, 100 + 10 * i + k)
    for i in range(4):
        s.ft[i].m_x, s.ft[i].m_y, s.ft[i].f_z = 200 + i, 210 + i, 220 + i
    for i in range(42):
        j = s.joint[i]
        j.ref, j.pos, j.cur, j.vel, j.heat, j.tmp = (i + x / 10 for x in (0, 1, 2, 3, 5, 6))
        if hasattr(j, "duty"):
            j.duty = i + 0.4
    for d in s.driver:
        d.temp = 99
    if hasattr(s, "power"):
        s.power.voltage, s.power.current, s.power.power = 48.5, 3.25, 157.625
    s.time, s.refWait = 1234.5, 7
    return s


@pytest.mark.parametrize("size", VERSIONS)
def test_every_version_has_its_size_and_every_member_its_place(size: int) -> None:
    whole = filled(size)
    assert ctypes.sizeof(whole) == size
    t_s, values = by_name(whole)
    assert t_s == 1234.5
    for name, tenth in (("ref", 0), ("pos", 1), ("cur", 2), ("heat", 5), ("temp", 6)):
        assert values[name] == {joint: i + tenth / 10 for joint, i in SLOT.items()}, name
    assert values["vel"] == {j: None if j[1] == "F" else i + 0.3 for j, i in SLOT.items()}
    if hasattr(whole.joint[0], "duty"):
        assert values["duty"]["RKN"] == SLOT["RKN"] + 0.4
    else:
        assert "duty" not in values
    assert values["ftm"] == {
        f"{site}.{c}": 200 + 10 * k + i
        for i, site in enumerate(("RH", "LH", "RF", "LF"))
        for k, c in enumerate(("mx", "my"))
    }
    assert values["ftf"] == {f"{site}.fz": 220 + i for i, site in enumerate(("RH", "LH", "RF", "LF"))}
    imus = list(enumerate(("RF", "LF", "torso")))
    assert values["tilt"] == {
        f"{s}.{c}": 100 + 10 * i + k for i, s in imus for k, c in ((0, "roll"), (1, "pitch"))
    }
    assert values["gyro"] == {f"{s}.{c}": 103 + 10 * i + k for i, s in imus for k, c in ((0, "x"), (1, "y"))}
    power = [values.get(name) for name in ("volt", "amp", "watt")]
    present = [{"main": 48.5}, {"main": 3.25}, {"main": 157.625}]
    assert power == (present if hasattr(whole, "power") else [None, None, None])


@pytest.mark.parametrize("size", [0, 1, 3632, 3897, 3899, 462, 65536])
def test_any_other_length_is_refused_in_one_line(size: int) -> None:
    with pytest.raises(UnknownFrame) as caught:
        HuboDecoder(None).decode(bytes(size))
    assert str(caught.value).startswith(f"a frame of {size} bytes is not a known hubo_state (3368, ")


@pytest.mark.parametrize("name", STATUS_BYTES)
def test_each_status_byte_is_a_flag_of_its_joint_alone(name: str) -> None:
    s = state()
    setattr(s.status[SLOT["LSR"]], name, 6 if name == "homeFlag" else 1)
    flags = by_name(s)[1]["flags"]
    said = {b for i, b in enumerate(BITS) if flags["LSR"] >> i & 1} - {"active"}
    assert said == {"homeFlag": {"homed"}, "ctrlOn": {"ctrlOn", "enabled"}}.get(name, {name})
    assert {flags[j] for j in SLOT if j != "LSR"} == {1 << BITS.index("active")}


def test_homed_is_six_and_two_for_the_wrist_rolls() -> None:
    for value, homed in ((6, set(SLOT)), (2, {"LWR", "RWR"}), (1, set()), (14, set())):
        s = state()
        for i in range(42):
            s.status[i].homeFlag = value
        flags = by_name(s)[1]["flags"]
        assert {j for j in SLOT if flags[j] >> BITS.index("homed") & 1} == homed, value


def test_compliance_is_one_and_two() -> None:
    s = state()
    for i, name in enumerate(("LSP", "LSR", "LSY", "LEB")):
        s.joint[SLOT[name]].comply = i  # 3: the motor is being turned on
    flags = by_name(s)[1]["flags"]
    assert [j for j in SLOT if flags[j] >> BITS.index("comply") & 1] == ["LSR", "LSY"]


def test_a_joint_without_a_motor_has_no_readings_and_a_cold_board_no_temperature() -> None:
    s = filled(3898)
    s.joint[SLOT["NK1"]].active = 0
    s.joint[SLOT["RKN"]].tmp = 0
    values = by_name(s)[1]
    assert {values[f]["NK1"] for f in ("ref", "pos", "cur", "temp", "flags")} == {None}
    assert values["temp"]["RKN"] is None
    assert values["pos"]["NKY"] == 1.1
    for i in range(42):
        s.joint[i].active = 0  # a simulator that leaves the byte alone
    assert by_name(s)[1]["pos"]["NK1"] == 2.1


def test_a_flag_that_comes_and_goes_is_seen_in_each_frame() -> None:
    decoder, s = HuboDecoder(None), state()
    seen = []
    for jam in (0, 1, 1, 0):
        s.status[5].jam = jam
        values: Any = decoder.decode(bytes(s))[1]
        seen.append(values["flags"]["LSR"] >> BITS.index("jam") & 1)
    assert seen == [0, 1, 1, 0]


@pytest.mark.parametrize("name", ["hubo2plus", "drchubo"])
def test_with_a_profile_values_stand_in_its_order(name: str) -> None:
    profile = load_profile(PROFILES / f"{name}.toml")
    decoder = HuboDecoder(profile)
    s = filled(3898)
    s.status[SLOT["LSR"]].jam = 1
    s.status[SLOT["LSR"]].limitSwitch = 1
    values: Any = decoder.decode(bytes(s))[1]
    assert decoder.unknown == []
    assert [f.name for f in profile.fields if f.name not in values] == []
    for f in profile.fields:
        assert len(values[f.name]) == len(f.labels), f.name
    labels = profile.labels["joint"]
    assert set(labels) <= set(NAMES)
    assert list(values["pos"]) == [SLOT[j] + 0.1 for j in labels]
    assert list(values["ftf"]) == [220, 221, 222, 223]
    assert list(values["tilt"]) == [120, 121, 100, 101, 110, 111]
    assert (values["volt"], values["amp"]) == ([48.5], [3.25])
    said = set()
    for f in profile.fields:
        if f.bits:
            mask = values[f.name][labels.index("LSR")]
            said |= {b for i, b in enumerate(f.bits) if mask >> i & 1}
    assert said == {"jam", "limitSwitch", "active"}


def test_the_shipped_profiles_show_all_seventeen_status_bytes() -> None:
    for name in ("hubo2plus", "drchubo"):
        bits = {b for f in load_profile(PROFILES / f"{name}.toml").fields for b in f.bits}
        shown = {{"homeFlag": "homed", "ctrlOn": "enabled"}.get(b, b) for b in STATUS_BYTES}
        assert shown | {"active", "comply"} == bits


def test_what_the_profile_asks_in_vain_is_named() -> None:
    from posecast_edge.profile.reader import parse_profile

    decoder = HuboDecoder(
        parse_profile(
            '[labels]\njoint=["RKN","TAIL"]\n[[fields]]\nname="pos"\n[[fields]]\nname="ftf"\nlabels=["RF.fx"]\n'
            '[[fields]]\nname="flags"\nbits=["jam","bored"]\n[[fields]]\nname="watt"\nlabels=["main"]\n'
        )
    )
    _, values = decoder.decode(bytes(filled(3898)))
    assert decoder.unknown == ["pos.TAIL", "ftf.RF.fx", "flags.TAIL", "flags: bit bored"]
    assert values["pos"] == [29.1, None]
    assert values["ftf"] == [None]
    assert values["watt"] == [157.625]


@pytest.mark.parametrize("size", VERSIONS)
def test_noise_of_the_right_length_breaks_nothing(size: int) -> None:
    """NaN, infinities, masks of 255: what a damaged frame holds goes through the whole pure half."""
    profile = load_profile(PROFILES / "hubo2plus.toml")
    decoder, stream = HuboDecoder(profile), Stream(profile, 4.0, lambda line: None)
    wire = WireDecoder()
    wire.add_schema(stream.schema.text)
    dice = random.Random(size)
    frames = 0
    for k in range(200):
        t_s, values = decoder.decode(dice.randbytes(size))
        now_s = k / 30
        stream.deliver(Sample(t_s, values, exact=True), now_s)
        frame = stream.tick(now_s)
        if frame is not None:
            wire.decode(frame.data)
            frames += 1
    assert frames > 100
