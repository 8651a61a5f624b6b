"""Source `mujoco`: MJCF and URDF, simulated and read as fields."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import pytest
from command_stage import run_edge
from model_stage import shared_robot
from posecast_edge.model.urdf.reader import load_urdf
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.registry import find_defaults, open_source

mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")

from posecast_edge.sources.mujoco.model import (  # noqa: E402
    GO_S,
    STAY_S,
    TURN_S,
    Simulation,
    load_simulation,
    strip_visuals,
)
from posecast_edge.sources.mujoco.source import ARM  # noqa: E402

WALKER = """
<mujoco>
  <worldbody>
    <geom type="plane" size="5 5 .1"/>
    <body name="trunk" pos="0 0 1">
      <freejoint/>
      <geom type="box" size=".2 .1 .1" mass="5"/>
      <site name="imu" pos="0 0 .1"/>
      <body name="leg">
        <joint name="knee" axis="0 1 0" range="-30 60"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".04" mass="1"/>
        <site name="foot.left" pos="0 0 -.3"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="knee servo" joint="knee" kp="200" kv="5"/>
    <motor name="kick" joint="knee"/>
  </actuator>
  <sensor>
    <accelerometer site="imu"/>
    <gyro site="imu"/>
    <framequat objtype="site" objname="imu"/>
    <force site="foot.left"/>
    <touch site="foot.left"/>
  </sensor>
</mujoco>
"""


def mjcf(tmp_path: Path, text: str = WALKER) -> Simulation:
    path = tmp_path / "model.xml"
    path.write_text(text)
    return load_simulation(path)


def play(simulation: Simulation, seconds: float) -> list[Sample]:
    found = []
    for _ in range(round(seconds / 0.01)):
        simulation.advance(0.01)
        found.append(simulation.make_sample())
    return found


def value(sample: Sample, field: str, label: str) -> float:
    found = sample.values[field]
    assert isinstance(found, dict)
    return float(found[label])


def test_a_model_of_somebody_else(tmp_path: Path) -> None:
    first = play(mjcf(tmp_path), 0.01)[0]
    labels = {name: tuple(values) for name, values in first.values.items()}
    assert labels == {
        "ref": ("knee",),
        "pos": ("knee",),
        "vel": ("knee",),
        "effort": ("knee",),
        "base": ("base.x", "base.y", "base.z"),
        "baseq": ("base.w", "base.x", "base.y", "base.z"),
        "acc": ("imu.x", "imu.y", "imu.z"),
        "gyro": ("imu.x", "imu.y", "imu.z"),
        "quat": ("imu.w", "imu.x", "imu.y", "imu.z"),
        "ftf": ("foot_left.fx", "foot_left.fy", "foot_left.fz"),
    }
    assert first.links == {"imu": "trunk", "foot_left": "leg"}


def test_it_falls_as_things_fall(tmp_path: Path) -> None:
    samples = play(mjcf(tmp_path), 0.3)
    for sample in samples:
        assert value(sample, "base", "base.z") == pytest.approx(1 - 9.81 / 2 * sample.t_s**2, abs=0.02)
    assert [s.t_s for s in samples] == [pytest.approx(0.01 * (k + 1)) for k in range(30)]


def test_keyframes_are_gone_through(tmp_path: Path) -> None:
    keys = '<keyframe><key ctrl="0 0"/><key ctrl="0.6 0"/></keyframe></mujoco>'
    fixed = WALKER.replace("<freejoint/>", "").replace("</mujoco>", keys)
    samples = play(mjcf(tmp_path, fixed), 2 * (GO_S + STAY_S))
    there, back = samples[round(100 * (GO_S + STAY_S)) - 2], samples[-2]
    assert value(there, "ref", "knee") == pytest.approx(0.6)
    assert value(back, "ref", "knee") == pytest.approx(0)
    assert value(there, "pos", "knee") == pytest.approx(0.6, abs=0.05)
    jumps = [abs(value(b, "ref", "knee") - value(a, "ref", "knee")) for a, b in itertools.pairwise(samples)]
    assert max(jumps) < 0.02


HOME = (
    '<keyframe><key name="home" qpos="0 0 2 1 0 0 0 0.4" time="7"/>'
    '<key qpos="0 0 1 1 0 0 0 0"/></keyframe></mujoco>'
)


def test_it_starts_in_the_first_keyframe_and_its_servos_hold_it(tmp_path: Path) -> None:
    fixed = WALKER.replace("<freejoint/>", "").replace("</mujoco>", HOME.replace("0 0 2 1 0 0 0 ", ""))
    fixed = fixed.replace('<key qpos="0 0 1 1 0 0 0 0"/>', '<key qpos="0"/>')
    samples = play(mjcf(tmp_path, fixed), 0.2)
    assert samples[0].t_s == pytest.approx(0.01)
    for sample in samples:
        assert value(sample, "pos", "knee") == pytest.approx(0.4, abs=0.05)
    free = play(mjcf(tmp_path, WALKER.replace("</mujoco>", HOME)), 0.01)[0]
    assert value(free, "base", "base.z") == pytest.approx(2, abs=0.01)
    assert value(free, "pos", "knee") == pytest.approx(0.4, abs=0.01)


def test_an_unstable_model_begins_anew_in_its_first_keyframe(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    wild = WALKER.replace("</mujoco>", HOME).replace('kp="200" kv="5"', 'kp="1e12" kv="0"')
    samples = play(mjcf(tmp_path, wild), 0.3)
    assert "s and was restarted" in caplog.text
    assert max(value(sample, "base", "base.z") for sample in samples[5:]) > 1.9


MOTORS = """<mujoco><option gravity="{0}"/><worldbody><body><joint name="{1}" axis="0 0 1"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".04"/></body></worldbody>
<actuator><motor joint="{1}"/>{2}</actuator></mujoco>"""


@pytest.mark.parametrize(
    ("gravity", "more", "why"),
    [
        ("0 -9.8 0", "", "falls"),
        ("0 0 -9.8", "", "stands still"),
        ("0 -9.8 0", '<position joint="j" kp="5"/>', ""),
        ("0 -9.8 0", '<intvelocity joint="j" kp="5" actrange="-1 1"/>', ""),
    ],
)
def test_why_a_model_of_motors_falls_is_said(tmp_path: Path, gravity: str, more: str, why: str) -> None:
    model = tmp_path / "motors.xml"
    model.write_text(MOTORS.format(gravity, "j", more))
    line = f"this model's actuators are motors: with no controller it {why}"
    assert load_simulation(model).explain_rest() == (line if why else "")


def test_run_says_why_it_falls(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    model = tmp_path / "motors.xml"
    model.write_text(MOTORS.format("0 -9.8 0", "j", ""))
    with caplog.at_level("INFO", "posecast_edge.mujoco"):
        open_source(f"mujoco:{model}", None)
    assert caplog.messages == [
        "mujoco motors.xml: this model's actuators are motors: with no controller it falls"
    ]


def test_the_arm_moves_each_joint_and_holds_the_others() -> None:
    simulation = load_simulation(ARM)
    joints = [s.joint for s in simulation.servos]
    assert joints == ["turn", "lift", "elbow", "wrist", "finger_left", "finger_right"]
    samples = play(simulation, TURN_S * len(joints))
    for k, joint in enumerate(joints):
        during = samples[round(100 * TURN_S * k) : round(100 * TURN_S * (k + 1))]
        reach = max(abs(value(s, "pos", joint) - value(samples[0], "pos", joint)) for s in during)
        assert reach > (0.01 if joint.startswith("finger") else 0.4), joint
    for sample in samples:
        for joint in joints:
            assert abs(value(sample, "ref", joint) - value(sample, "pos", joint)) < 0.05, joint


def test_the_arm_keeps_to_its_limits_and_the_doctor_likes_it() -> None:
    limits = {j.name: j.limit for j in load_urdf(ARM).joints}
    for sample in play(load_simulation(ARM), TURN_S * 6):
        for joint, limit in limits.items():
            position = value(sample, "pos", joint)
            assert limit is not None
            assert limit.lower is not None
            assert limit.upper is not None
            assert limit.lower - 0.01 <= position <= limit.upper + 0.01, joint
    done = run_edge("doctor", "--source", "mujoco", "--urdf", str(ARM), "--seconds", "1")
    assert (done.returncode, done.stderr) == (0, ""), done.stdout


def test_a_joint_that_mimics_another_follows_it(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    tie = '<mimic joint="finger_left" multiplier="0.5"/></joint>'
    head, _, tail = ARM.read_text().rpartition("</joint>")
    path.write_text(head + tie + tail)
    simulation = load_simulation(path)
    assert "finger_right" not in [s.joint for s in simulation.servos]
    ends = play(simulation, TURN_S * 4.5)[-1]
    assert value(ends, "pos", "finger_right") == pytest.approx(
        value(ends, "pos", "finger_left") / 2, abs=0.004
    )


def test_the_simulated_mjcf_is_what_is_seen_too(tmp_path: Path) -> None:
    robot = tmp_path / "robot.xml"
    robot.write_text("<mujoco><worldbody/></mujoco>")
    assert find_defaults(f"mujoco:{robot}").urdf == robot
    (tmp_path / "robot.mjb").write_bytes(b"\x00\x01")
    assert find_defaults(f"mujoco:{tmp_path}/robot.mjb").urdf is None, "compiled: nothing to build from"


def test_a_urdf_is_what_is_seen_too_and_meshes_are_no_hindrance(tmp_path: Path) -> None:
    assert find_defaults("mujoco").urdf == ARM
    assert find_defaults(f"mujoco:{tmp_path}/a.urdf").urdf == tmp_path / "a.urdf"
    assert find_defaults(f"mujoco:{tmp_path}/a.xml").urdf is None, "no such file: the source says so"
    mesh = b'<visual><geometry><mesh filename="package://nobody/has.dae"/></geometry></visual><inertial>'
    assert b"nobody" not in strip_visuals(ARM.read_bytes().replace(b"<inertial>", mesh, 1)).encode()


def test_an_unstable_model_begins_anew_and_time_goes_on(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    wild = WALKER.replace("<freejoint/>", "").replace('kp="200" kv="5"', 'kp="1e12" kv="0"')
    samples = play(mjcf(tmp_path, wild), 1)
    assert all(a.t_s < b.t_s for a, b in itertools.pairwise(samples))
    assert all(math.isfinite(value(s, "pos", "knee")) for s in samples)
    assert "s and was restarted" in caplog.text


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("a.xml", "<mujoco><worldbody/></mujoco>", "the model has no joint that moves"),
        ("a.xml", "<mujoco><worldboy/></mujoco>", "Schema violation"),
        ("a.xml", "not xml", ""),
        ("a.urdf", "<robot name='x'><link", ":1: not XML"),
        ("a.urdf", "<sdf/>", ":1: this is SDF, not URDF"),
        ("a.urdf", "<robot name='x'><link name='a'/></robot>", "the model has no joint that moves"),
    ],
)
def test_models_that_are_refused_in_one_line(tmp_path: Path, name: str, text: str, reason: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(SourceError) as e:
        open_source(f"mujoco:{path}", None)
    assert str(e.value).startswith(str(path))
    assert reason in str(e.value)
    assert "\n" not in str(e.value)


def test_a_model_that_is_not_there() -> None:
    with pytest.raises(SourceError, match=r"^/none\.xml: No such file or directory$"):
        open_source("mujoco:/none.xml", None)


@pytest.mark.parametrize("name", ["hubo2plus-collision", "drchubo", "g1"])
def test_real_robots_hold_still_and_move_as_told(name: str, caplog: pytest.LogCaptureFixture) -> None:
    simulation = load_simulation(shared_robot(name))
    assert len(simulation.servos) == len(simulation.joints)
    for sample in play(simulation, 2 * TURN_S):
        for servo in simulation.servos:
            told, stands = value(sample, "ref", servo.joint), value(sample, "pos", servo.joint)
            assert abs(told - stands) < 0.05, servo.joint
    assert caplog.messages == []


def test_a_slide_is_metres_in_probe_too(tmp_path: Path) -> None:
    slide = WALKER.replace('<joint name="knee" axis="0 1 0"', '<joint name="knee" type="slide" axis="0 0 1"')
    assert mjcf(tmp_path).make_sample().sliding == frozenset()
    assert mjcf(tmp_path, slide).make_sample().sliding == {"knee"}
    path = tmp_path / "gantry.xml"
    path.write_text(slide)
    probed = run_edge("probe", f"mujoco:{path}", "--seconds", "0.3")
    assert probed.returncode == 0, probed.stderr
    units = {tuple(line.split()[:3]) for line in probed.stdout.splitlines() if line[:1].isalpha()}
    assert {("pos", "1", "m"), ("vel", "1", "m/s"), ("effort", "1", "N")} <= units
