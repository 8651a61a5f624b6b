"""The minute as the robot lives it: what the servos are told (ref), where they are (pos), where it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from demo_robot import dynamics, programme
from demo_robot.dynamics import Dynamics, Wrench, at, of_links, pressure
from demo_robot.gait import Gait, ease, follow, window
from demo_robot.kinematics import forward, inverse, leg, matrix, quaternion, rotation, transform
from demo_robot.masses import Inertial
from demo_robot.programme import FREE_S, LEAVE_S, PERIOD_S, STALL_S, TOUCH_S
from demo_robot.robot import ANKLE, CHANNELS, FINGERS, HIP_Y, mapping
from demo_robot.shapes import Floats

RATE_HZ = 60  # of the file
FINE = 4  # computed this much finer
LAG_S = 0.014  # of every servo
ROUNDS = 6  # until the centre of mass is where the gait wants it; each leaves a fifth of the error

Channels = dict[str, Floats]


@dataclass(frozen=True)
class Motion:
    """At RATE_HZ: channels (n,), world_from_root (n, 4, 4), the gait that was planned."""

    t: Floats
    ref: Channels
    pos: Channels
    world_from_root: Floats
    gait: Gait
    effort_lost: Channels  # ref - pos beyond the lag, rad: what an obstacle or a jam holds back


def joints(channels: Channels) -> Channels:
    """Channels → URDF joints."""
    n = len(next(iter(channels.values())))
    return {
        joint: sum((gain * channels[c] for c, gain in terms), np.full(n, offset))
        for joint, (terms, offset) in mapping().items()
    }


def make(inertials: Mapping[str, Inertial]) -> Motion:
    """The whole minute. The same on every run."""
    plan = _planned(1)
    shift = np.zeros_like(plan.gait.com)
    for _ in range(ROUNDS):
        m = _moved(plan, shift)
        held = floor(solve(m, inertials), m.effort_lost)
        shift += follow(1 / RATE_HZ, plan.gait.zmp - dynamics.pressure(held))
    return _thinned(_moved(_planned(FINE), _refined(shift)))


def solve(m: Motion, inertials: Mapping[str, Inertial]) -> dynamics.Dynamics:
    """The forces behind a motion."""
    return dynamics.solve(joints(m.pos), m.world_from_root, inertials, RATE_HZ)


def _planned(fine: int) -> programme.Plan:
    n = round(PERIOD_S * RATE_HZ) * fine
    return programme.make(np.arange(n) / (RATE_HZ * fine))


def _moved(plan: programme.Plan, shift: Floats) -> Motion:
    """As the servos do it, the pelvis `shift` (n, 2) beside where a point mass would be."""
    t = plan.t
    ref = {**plan.upper, **_legs(plan, shift)}
    ref = {c: ref[c] for c in CHANNELS}
    held = _held(t, ref)
    pos = {c: _lagged(held[c], t) for c in CHANNELS}
    lost = {c: _lagged(ref[c] - held[c], t) for c in CHANNELS}
    return Motion(t, ref, pos, _base(t, plan.gait, pos), plan.gait, lost)


def _refined(values: Floats) -> Floats:
    """FINE as many samples of a ring, by its Fourier series."""
    return np.asarray(np.fft.irfft(np.fft.rfft(values, axis=0) * FINE, len(values) * FINE, axis=0))


def _thinned(m: Motion) -> Motion:
    def every(a: Floats) -> Floats:
        return a[::FINE]

    def channels(values: Channels) -> Channels:
        return {name: every(v) for name, v in values.items()}

    gait = m.gait
    feet = {side: type(foot)(**channels(vars(foot))) for side, foot in gait.feet.items()}
    thin = Gait(feet, channels(gait.centre), every(gait.zmp), every(gait.com), channels(gait.load))
    return Motion(
        every(m.t), channels(m.ref), channels(m.pos), every(m.world_from_root), thin, channels(m.effort_lost)
    )


def _ankles(t: Floats, gait: Gait) -> dict[str, Floats]:
    """world_from_ankle as planned. A foot that pitches does so about its ankle."""
    poses = {}
    for side, foot in gait.feet.items():
        z = foot.z + ANKLE + (programme.sole_height(t) if side == "R" else 0)
        turn = rotation("z", foot.yaw) @ rotation("y", foot.pitch)
        poses[side] = transform(turn, np.stack([foot.x, foot.y, z], axis=1))
    return poses


def _legs(plan: programme.Plan, shift: Floats) -> Channels:
    gait = plan.gait
    yaw = (gait.feet["L"].yaw + gait.feet["R"].yaw) / 2
    at = np.concatenate([gait.com + shift, plan.height[:, None]], axis=1)
    world_from_pelvis = transform(rotation("z", yaw) @ rotation("y", plan.bow), at)
    angles: Channels = {}
    for side, world_from_ankle in _ankles(plan.t, gait).items():
        hip = transform(np.eye(3)[None], np.array([[0, HIP_Y if side == "L" else -HIP_Y, 0]]))
        solved = leg(inverse(world_from_pelvis @ hip) @ world_from_ankle)
        angles |= {side + name: value for name, value in solved.items()}
    return angles


def _held(t: Floats, ref: Channels) -> Channels:
    """Where ref would get to: an obstacle stops the left arm, the right knee sticks in its gear."""
    held = dict(ref)
    touch = window(t, TOUCH_S, LEAVE_S, 0.4)
    for channel, limit in (("LSP", -0.86), ("LEB", -0.50)):
        excess = (
            np.maximum(0, limit - ref[channel]) if channel == "LSP" else np.maximum(0, ref[channel] - limit)
        )
        excess = _rounded(excess) * touch * 0.8
        held[channel] = ref[channel] + (excess if channel == "LSP" else -excess)
    stuck = ref["RKN"][np.searchsorted(t, STALL_S)]
    hold = ease((t - STALL_S) / 0.15) * (1 - ease((t - FREE_S) / 0.5))
    held["RKN"] = ref["RKN"] + hold * (stuck - ref["RKN"])
    return held


def _rounded(excess: Floats) -> Floats:
    """A corner of 0.05 rad rounded, so that a contact does not jerk."""
    return np.asarray(np.where(excess < 0.05, excess**2 / 0.1, excess - 0.025))


def _lagged(target: Floats, t: Floats) -> Floats:
    """First-order lag, settled over a period: the filter of the periodic signal, in its Fourier series."""
    omega = 2 * np.pi * np.fft.rfftfreq(len(t), t[1] - t[0])
    return np.asarray(np.fft.irfft(np.fft.rfft(target) / (1 + 1j * omega * LAG_S), len(t)))


def _base(t: Floats, gait: Gait, pos: Channels) -> Floats:
    """Odometry: the pelvis as seen from the feet that bear, each where it was put, weighted by its load."""
    root_from_foot = forward(
        joints(pos), np.broadcast_to(np.eye(4), (len(t), 4, 4)), frozenset(FOOT.values())
    )
    planned = _ankles(t, gait)
    seen = {side: planned[side] @ inverse(root_from_foot[link]) for side, link in FOOT.items()}
    left = gait.load["L"][:, None]
    at = left * seen["L"][:, :3, 3] + (1 - left) * seen["R"][:, :3, 3]
    ql, qr = quaternion(seen["L"][:, :3, :3]), quaternion(seen["R"][:, :3, :3])
    qr *= np.sign((ql * qr).sum(1))[:, None]
    return transform(matrix(left * ql + (1 - left) * qr), at)


FOOT = {"L": "Body_LAR", "R": "Body_RAR"}


# --- who holds the robot up: what the floor and an obstacle do to it, and what its four wrench sensors feel.
# Each feels what acts on the links beyond it from outside, in its link's axes. The foot's sensor sits in the
# sole: nothing weighs beneath it

SITES = {"RF": "Body_RAR", "LF": "Body_LAR", "RH": "Body_RWP", "LH": "Body_LWP"}
SENSOR_Z = -0.03  # in its link, as profiles/demo.toml has it
PALM_Z = -0.06  # where an obstacle pushes


def obstacle(links: Mapping[str, Floats], lost: Mapping[str, Floats]) -> Wrench:
    """What pushes the left hand back, by how far (rad) it holds the arm: along the hand, and across it."""
    hand = links[SITES["LH"]]
    push = np.stack([24.0 * lost["LEB"], np.zeros(len(hand)), -78.0 * lost["LSP"]], axis=1)
    return at(_point(hand, PALM_Z), np.einsum("nij,nj->ni", hand[:, :3, :3], push))


def floor(body: Dynamics, lost: Mapping[str, Floats]) -> Wrench:
    """What the floor must do, all else considered."""
    return body.needed.plus(obstacle(body.links, lost), -1)


def feel(
    body: Dynamics, gait: Gait, lost: Mapping[str, Floats], inertials: Mapping[str, Inertial], hz: float
) -> dict[str, Floats]:
    """fx fy fz mx my mz (n, 6) by site."""
    felt = {"RH": _hand(body, "R", inertials, hz), "LH": _hand(body, "L", inertials, hz)}
    felt["LH"] = felt["LH"].plus(obstacle(body.links, lost))
    felt |= _feet(floor(body, lost), gait)
    return {site: _at_sensor(felt[site], body.links[SITES[site]]) for site in ("RH", "LH", "RF", "LF")}


def _hand(body: Dynamics, side: str, inertials: Mapping[str, Inertial], hz: float) -> Wrench:
    """Its weight and its inertia pull at the wrist."""
    finger = "left" if side == "L" else "right"
    beyond = [
        SITES[side + "H"],
        *(f"{finger}{name}{part}" for name in FINGERS for part in ("Proximal", "Medial", "Distal")),
    ]
    needed = of_links(body.links, {link: inertials[link] for link in beyond}, hz)
    return Wrench(-needed.force, -needed.moment)


def _feet(total: Wrench, gait: Gait) -> dict[str, Wrench]:
    """Shared by the gait's load. Where both push is the total's pressure; each is as far off its centre as
    the other."""
    where, mean = pressure(total), sum(gait.load[s][:, None] * gait.centre[s] for s in "LR")
    feet = {}
    for side in "LR":
        point = np.zeros_like(total.force)
        point[:, :2] = gait.centre[side] + where - mean
        feet[side] = at(point, gait.load[side][:, None] * total.force)
    twist = total.plus(feet["L"], -1).plus(feet["R"], -1).moment[:, 2]  # all else is accounted for
    return {
        f"{side}F": Wrench(foot.force, foot.moment + np.outer(gait.load[side] * twist, [0, 0, 1]))
        for side, foot in feet.items()
    }


def _at_sensor(wrench: Wrench, link: Floats) -> Floats:
    moment = wrench.about(_point(link, SENSOR_Z))
    turn = link[:, :3, :3]
    return np.concatenate([np.einsum("nji,nj->ni", turn, v) for v in (wrench.force, moment)], axis=1)


def _point(link: Floats, z: float) -> Floats:
    return np.asarray(link[:, :3, 3] + z * link[:, :3, 2])
