"""A small humanoid in MuJoCo, with a force-torque sensor above each sole, that stands, leans and walks."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

Document = dict[str, Any]

STANCE_M = 0.09  # half the distance of the feet
THIGH_M, SHIN_M = 0.36, 0.36
SOLE = [[-0.07, -0.05, -0.04], [0.13, -0.05, -0.04], [0.13, 0.05, -0.04], [-0.07, 0.05, -0.04]]
JOINTS = ("hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
STEP_S = 0.002
SAMPLE_S = 0.02


def _leg(side: str, y: float) -> str:
    return f"""
    <body name="{side}_hip" pos="0 {y} -0.05"><joint name="{side}_hip_roll" axis="1 0 0"/>
      <inertial mass="0.8" pos="0 0 -0.02"
      diaginertia=".002 .002 .002"/>
     <body name="{side}_thigh" pos="0 0 0"><joint name="{side}_hip_pitch" axis="0 1 0"/>
      <inertial mass="3.2" pos="0.01 0 -0.17"
      diaginertia=".04 .04 .006"/>
      <body name="{side}_shin" pos="0 0 -{THIGH_M}"><joint name="{side}_knee" axis="0 1 0"/>
      <inertial mass="2.1" pos="0 0 -0.16"
      diaginertia=".03 .03 .004"/>
       <body name="{side}_ankle" pos="0 0 -{SHIN_M}"><joint name="{side}_ankle_pitch" axis="0 1 0"/>
      <inertial mass="0.4" pos="0 0 0"
      diaginertia=".001 .001 .001"/>
        <body name="{side}_foot" pos="0 0 0"><joint name="{side}_ankle_roll" axis="1 0 0"/>
         <inertial mass="0.25" pos="0.03 0 -0.03" diaginertia=".001 .001 .001"/>
         <geom name="{side}_sole" type="box" pos="0.03 0 -0.03" size="0.1 0.05 0.01"/>
         <site name="{side}_site" pos="0.02 0.005 -0.015" euler="10 -5 30"/>
    </body></body></body></body></body>"""


MODEL = f"""<mujoco><option timestep="{STEP_S}" integrator="implicitfast" cone="elliptic"/>
<compiler angle="degree"/>
<default><joint damping="1" armature="0.02" range="-90 90"/><geom friction="1 .01 .001"/></default>
<worldbody><geom name="floor" type="plane" size="0 0 1"/>
 <body name="trunk" pos="0 0 {THIGH_M + SHIN_M + 0.09}"><freejoint/>
 <inertial mass="18" pos="0.01 0.005 0.15" diaginertia=".5 .4 .2"/>
 {_leg("r", -STANCE_M)}{_leg("l", STANCE_M)}</body></worldbody>
<actuator>
{"".join(f'<position joint="{s}_{j}" kp="8000" kv="150"/>' for s in "rl" for j in JOINTS)}
</actuator>
<sensor>
{"".join(f'<{kind} name="{s}_{kind}" site="{s}_site"/>' for s in "rl" for kind in ("force", "torque"))}
</sensor>
</mujoco>"""  # fmt: skip


def make_manifest(model: Any) -> Document:
    """The same robot as the page sees it."""
    bodies = range(1, model.nbody)
    joints, inertials = [], []
    for body in bodies:
        inertials.append(
            {
                "link": body - 1,
                "mass_kg": float(model.body_mass[body]),
                "xyz": model.body_ipos[body].tolist(),
                "inertia": [1, 0, 0, 1, 0, 1],
            }
        )
        if body == 1:
            continue
        joint = int(model.body_jntadr[body])
        joints.append(
            {
                "name": model.joint(joint).name,
                "type": "revolute",
                "parent": int(model.body_parentid[body]) - 1,
                "child": body - 1,
                "xyz": model.body_pos[body].tolist(),
                "quat": model.body_quat[body].tolist(),
                "axis": model.jnt_axis[joint].tolist(),
            }
        )
    soles = [{"link": model.body(f"{s}_foot").id - 1, "points": SOLE} for s in "rl"]
    return {
        "v": 2,
        "robot": "r",
        "files": [],
        "levels": [],
        "visuals": [],
        "links": [model.body(body).name for body in bodies],
        "joints": joints,
        "inertials": inertials,
        "soles": soles,
    }


def make_sensors(model: Any) -> Document:
    """Where the sites are, for the schema's mapping."""
    found = {}
    for s in "rl":
        site = model.site(f"{s}_site")
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, site.quat)
        r = turn.reshape(3, 3)
        rpy = [math.atan2(r[2, 1], r[2, 2]), -math.asin(r[2, 0]), math.atan2(r[1, 0], r[0, 0])]
        found[s] = {"kind": "wrench", "name": s, "link": f"{s}_foot", "xyz": site.pos.tolist(), "rpy": rpy}
    return found


def bend(
    shift: float, right: float, left: float, ahead: tuple[float, float], lean: float
) -> dict[str, float]:
    """Joint angles for a trunk `shift` m to the left of the middle, with the feet raised by `right` and
    `left` m and moved `ahead` m; `lean` is how far the ankles lean ahead, rad."""
    joints = {}
    for s, lift, x in (("r", right, ahead[0]), ("l", left, ahead[1])):
        height = THIGH_M + SHIN_M - 0.03 - lift
        roll = math.atan2(shift, height)
        reach = min(math.hypot(height, x) / math.cos(roll), THIGH_M + SHIN_M - 1e-4)
        knee = math.pi - math.acos((THIGH_M**2 + SHIN_M**2 - reach**2) / (2 * THIGH_M * SHIN_M))
        forward = math.atan2(x, height)
        joints[f"{s}_hip_roll"], joints[f"{s}_ankle_roll"] = -roll, roll
        joints[f"{s}_hip_pitch"] = -forward - knee / 2
        joints[f"{s}_knee"] = knee
        joints[f"{s}_ankle_pitch"] = forward - knee / 2 - lean
    return joints


def _ease(part: float) -> float:
    part = min(1.0, max(0.0, part))
    return part * part * (3 - 2 * part)


def stand(t: float) -> dict[str, float]:
    """It sways a little."""
    return bend(0.015 * math.sin(2 * t), 0, 0, (0, 0), 0.01 * math.sin(3 * t))


def lean(t: float) -> dict[str, float]:
    """Leans forward until it is near the edge, then to one side."""
    return bend(0.05 * _ease((t - 4) / 2), 0, 0, (0, 0), 0.07 * _ease(t / 3))


def walk(t: float) -> dict[str, float]:
    """A step every four seconds: shift onto one foot, move the other one up, forward and down."""
    stride = 0.05
    number, part = int(t // 4), (t % 4) / 4
    onto = -1 if number % 2 == 0 else 1  # the foot that bears: right, then left
    before = 0 if number == 0 else -onto
    shift = STANCE_M * 1.03 * (before + (onto - before) * _ease(part / 0.5))
    lift = 0.04 * _ease((part - 0.5) / 0.15) * (1 - _ease((part - 0.78) / 0.2))
    swing = (
        stride * (_ease((part - 0.6) / 0.25) * 2 - 1) if number > 0 else stride * _ease((part - 0.6) / 0.25)
    )
    stood = -swing
    ahead = (stood, swing) if onto < 0 else (swing, stood)
    return bend(shift, lift if onto > 0 else 0, lift if onto < 0 else 0, ahead, 0)


GAITS = {"standing": (stand, 4.0), "leaning": (lean, 7.0), "walking": (walk, 16.0)}


def play(gait: str) -> Iterator[tuple[Any, Any]]:
    """The model and its data every `SAMPLE_S`, after it has settled for half a second."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    wanted, seconds = GAITS[gait]

    def command(t: float) -> None:
        for name, angle in wanted(t).items():
            data.ctrl[[model.actuator(i).trnid[0] for i in range(model.nu)].index(model.joint(name).id)] = (
                angle
            )

    for name, angle in wanted(0).items():
        data.qpos[model.joint(name).qposadr[0]] = angle
    data.qpos[2] = THIGH_M + SHIN_M - 0.03 + 0.04 + 0.05
    settle = 0.5
    every = round(SAMPLE_S / STEP_S)
    for step in range(round((settle + seconds) / STEP_S)):
        command(max(0.0, data.time - settle))
        mujoco.mj_step(model, data)
        if data.time > settle and step % every == 0:
            mujoco.mj_forward(model, data)
            yield model, data


def find_pressure(model: Any, data: Any) -> tuple[dict[str, Any], dict[str, float]]:
    """For each foot, the centre of pressure (world, m; None without contact) and the force (N), from MuJoCo's
    contacts."""
    sums = {s: np.zeros(3) for s in "rl"}
    forces = dict.fromkeys("rl", 0.0)
    for i in range(data.ncon):
        contact = data.contact[i]
        names = {model.geom(int(g)).name for g in contact.geom}
        side = next((s for s in "rl" if f"{s}_sole" in names), None)
        if side is None:
            continue
        wrench = np.zeros(6)
        mujoco.mj_contactForce(model, data, i, wrench)
        force = abs(float((contact.frame.reshape(3, 3).T @ wrench[:3])[2]))
        sums[side] += force * contact.pos
        forces[side] += force
    return {s: sums[s] / forces[s] if forces[s] > 0 else None for s in "rl"}, forces
