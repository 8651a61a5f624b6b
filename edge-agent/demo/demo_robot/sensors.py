"""What the sensors say: wrenches, IMUs, currents, temperatures, power, flags.

Noise as measured on real robots, from a fixed seed: encoders 2e-4 rad, currents 0.02-0.03 A, IMUs standing
0.002 rad/s and 0.04 m/s², walking about ten times that, most at the impacts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from demo_robot import dynamics, motion
from demo_robot.dynamics import GRAVITY
from demo_robot.kinematics import quaternion
from demo_robot.masses import Inertial
from demo_robot.motion import RATE_HZ, Channels, Motion
from demo_robot.programme import DEAD_S, FREE_S, HOMING_S, LEAVE_S, STALL_S, TOUCH_S
from demo_robot.robot import CHANNELS, MASS_KG
from demo_robot.shapes import Floats

BITS = (
    "homed",
    "enabled",
    "jam",
    "pwmSaturated",
    "bigError",
    "encError",
    "driverFault",
    "motorFail0",
    "motorFail1",
    "posMinError",
    "posMaxError",
    "velError",
    "accError",
    "tempError",
    "comply",
)
HIP_ARM = 0.05  # m, from the hip to the line of the load
ROOM_C = 31.0
HEAT_S = 22.0  # how fast a motor warms; a real one takes minutes, the demo lasts one
LINKS = {"torso": "Body_Torso", "RF": "Body_RAR", "LF": "Body_LAR"}


@dataclass(frozen=True)
class Field:
    """One field of the file: its labels, unit per count, values (n, labels); NaN = no reading."""

    name: str
    labels: tuple[str, ...]
    scale: float
    values: Floats


def fields(m: Motion, inertials: Mapping[str, Inertial]) -> list[Field]:
    """All fields of the minute, in the profile's order."""
    noise = np.random.default_rng(20140615)
    n = len(m.t)
    body = motion.solve(m, inertials)
    moving = _moving(m)

    def joint(name: str, scale: float, values: Channels) -> Field:
        return Field(name, CHANNELS, scale, np.stack([values[c] for c in CHANNELS], axis=1))

    pos = {c: v + noise.normal(0, 2e-4, n) for c, v in m.pos.items()}
    current = _currents(m, noise)
    wrench = _wrenches(m, body, inertials, noise)
    quat, gyro, acc = _imus(m, body.links, moving, noise)
    amp = 2.6 + 0.16 * sum(np.abs(v) for v in current.values()) + noise.normal(0, 0.05, n)
    volt = 49.6 - 0.045 * _smoothed(amp, 0.2) + noise.normal(0, 0.02, n)
    base = m.world_from_root
    return [
        joint("ref", 1e-4, m.ref),
        joint("pos", 1e-4, pos),
        joint("cur", 0.01, current),
        Field("ftm", _labels(wrench, "mx my mz"), 0.005, _columns(wrench, slice(3, 6))),
        Field("ftf", _labels(wrench, "fx fy fz"), 0.05, _columns(wrench, slice(0, 3))),
        Field("quat", _labels(quat, "w x y z"), 1e-4, _columns(quat, slice(0, 4))),
        Field("gyro", _labels(gyro, "x y z"), 0.002, _columns(gyro, slice(0, 3))),
        Field("acc", _labels(acc, "x y z"), 0.01, _columns(acc, slice(0, 3))),
        Field("volt", ("main",), 0.01, volt[:, None]),
        Field("amp", ("main",), 0.01, amp[:, None]),
        joint("temp", 0.1, _temperatures(current, noise)),
        joint("flags", 1, _flags(m)),
        Field("base", ("base.x", "base.y", "base.z"), 1e-4, base[:, :3, 3]),
        Field("baseq", ("base.w", "base.x", "base.y", "base.z"), 1e-4, quaternion(base[:, :3, :3])),
    ]


def _labels(sites: dict[str, Floats], components: str) -> tuple[str, ...]:
    return tuple(f"{site}.{c}" for site in sites for c in components.split())


def _columns(sites: dict[str, Floats], part: slice) -> Floats:
    return np.concatenate([v[:, part] for v in sites.values()], axis=1)


def _rate(values: Floats) -> Floats:
    """Per second."""
    return dynamics.rate(values, RATE_HZ)


def _smoothed(values: Floats, lag_s: float) -> Floats:
    """First-order lag along time, closed to a ring."""
    omega = 2 * np.pi * np.fft.rfftfreq(len(values), 1 / RATE_HZ)
    return np.asarray(np.fft.irfft(np.fft.rfft(values) / (1 + 1j * omega * lag_s), len(values)))


def _moving(m: Motion) -> Floats:
    """0 standing … 1 walking."""
    speed = sum(np.abs(_rate(m.ref[c])) for c in ("LKN", "RKN", "LHP", "RHP"))
    return np.clip(_smoothed(np.asarray(speed), 0.25) / 4, 0, 1)


def _landings(m: Motion, side: str) -> Floats:
    """Of each landing a short knock, 1 at its height."""
    stands = m.gait.feet[side].stands
    knock = np.zeros_like(m.t)
    for i in np.flatnonzero((stands == 1) & (np.roll(stands, 1) == 0)):
        since = (m.t - m.t[i]) % m.t[-1]
        knock += (since / 0.035) * np.exp(1 - since / 0.035) * (since < 0.6)
    return knock


def _wrenches(
    m: Motion, body: dynamics.Dynamics, inertials: Mapping[str, Inertial], noise: np.random.Generator
) -> dict[str, Floats]:
    """Forces and moments on each sensor in its link's axes: fx fy fz mx my mz."""
    sigma = {"H": (0.12, 0.012), "F": (0.8, 0.05)}
    felt = motion.feel(body, m.gait, m.effort_lost, inertials, RATE_HZ)
    return {site: v + noise.normal(0, 1, v.shape) * np.repeat(sigma[site[1]], 3) for site, v in felt.items()}


def _imus(
    m: Motion, links: dict[str, Floats], moving: Floats, noise: np.random.Generator
) -> tuple[dict[str, Floats], dict[str, Floats], dict[str, Floats]]:
    """Orientation, rate, acceleration (with gravity) in the sensor's axes. The left foot's fails once."""
    n = len(m.t)
    quats, gyros, accs = {}, {}, {}
    knock = {"RF": _landings(m, "R"), "LF": _landings(m, "L")}
    knock["torso"] = 0.25 * (knock["RF"] + knock["LF"])
    for site in ("torso", "RF", "LF"):
        pose = links[LINKS[site]]
        turn = pose[:, :3, :3]
        spin = np.swapaxes(turn, 1, 2) @ _rate(turn)
        gyro = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        world = _rate(_rate(pose[:, :3, 3])) + np.array([0, 0, GRAVITY])
        acc = np.einsum("nji,nj->ni", turn, world)
        shake = knock[site][:, None] * noise.normal(0, 1, (n, 3))
        gyro += noise.normal(0, 1, (n, 3)) * (0.002 + 0.012 * moving[:, None]) + 0.08 * shake
        acc += noise.normal(0, 1, (n, 3)) * (0.04 + 0.15 * moving[:, None]) + 2.2 * shake
        quat = quaternion(turn) + noise.normal(0, 2e-4, (n, 4))
        quat /= np.linalg.norm(quat, axis=1, keepdims=True)
        if site == "LF":
            dead = (m.t >= DEAD_S[0]) & (m.t < DEAD_S[1])
            for values in (quat, gyro, acc):
                values[dead] = np.nan
        quats[site], gyros[site], accs[site] = quat, gyro, acc
    return quats, gyros, accs


def _currents(m: Motion, noise: np.random.Generator) -> Channels:
    """Holding torque, friction, and what a motor spends against an obstacle, A."""
    n, weight = len(m.t), MASS_KG * GRAVITY
    hold: Channels = {c: np.zeros(n) for c in CHANNELS}
    for side, sign in (("L", 1), ("R", -1)):
        load, knee = m.gait.load[side], m.pos[f"{side}KN"]
        hold[f"{side}KN"] = load * weight * 0.3 * np.sin(knee / 2) / 16
        hold[f"{side}HP"] = -load * weight * 0.04 / 16 - 0.5 * np.sin(m.pos[f"{side}HP"]) * (1 - load) * 3
        hold[f"{side}HR"] = -sign * (load - 0.5 * load**2) * weight * HIP_ARM / 16
        foot = m.gait.feet[side]
        ahead = np.hypot(*(m.gait.centre[side] - np.stack([foot.x, foot.y], axis=1)).T)
        hold[f"{side}AP"] = load * weight * ahead / 12
        hold[f"{side}AR"] = sign * load * 0.3
        arm, elbow = m.pos[f"{side}SP"], m.pos[f"{side}SP"] + m.pos[f"{side}EB"]
        hold[f"{side}SP"] = (3.4 * np.sin(arm) + 1.6 * np.sin(elbow)) / 2.2
        hold[f"{side}SR"] = sign * 0.25 + 1.1 * np.sin(m.pos[f"{side}SR"])
        hold[f"{side}EB"] = 1.6 * np.sin(elbow) / 1.6
    gear = {"KN": 0.50, "HP": 0.45, "HR": 0.35, "AP": 0.30}
    currents: Channels = {}
    for c in CHANNELS:
        finger = c[1:2] == "F"
        friction = (0.12 if finger else gear.get(c[1:], 0.22)) * np.tanh(_rate(m.ref[c]) * 4)
        against = np.clip(m.effort_lost[c] * (14 if c in ("LSP", "LEB") else 60), -10.4, 10.4)
        sigma = 0.012 if finger else 0.025
        currents[c] = hold[c] + friction + against + noise.normal(0, sigma, n)
    return currents


def _temperatures(current: Channels, noise: np.random.Generator) -> Channels:
    """Warmed by the current's square, °C. Finger and neck boards have no thermometer: no reading."""
    result: Channels = {}
    for k, c in enumerate(CHANNELS):
        if c[1:2] == "F" or c[:2] == "NK":
            result[c] = np.full(len(current[c]), np.nan)
            continue
        warm = _smoothed(np.minimum(current[c] ** 2, 110.0) * 1.55, HEAT_S)
        quiet = _smoothed(noise.normal(0, 1, len(warm)), 2.0)
        result[c] = ROOM_C + 1.3 * (k % 4) + warm + 0.4 * quiet
    return result


def _flags(m: Motion) -> Channels:
    """Bit masks. Who jams, saturates, complies, and who has not found its zero."""
    t = m.t
    bit = {name: 1 << i for i, name in enumerate(BITS)}
    flags = {c: np.full(len(t), bit["homed"] | bit["enabled"]) for c in CHANNELS}

    def during(start_s: float, end_s: float) -> Floats:
        return np.asarray((t >= start_s) & (t < end_s))

    def raise_bit(channel: str, name: str, start_s: float, end_s: float) -> None:
        flags[channel] = np.where(during(start_s, end_s), flags[channel] | bit[name], flags[channel])

    def drop_bit(channel: str, name: str, start_s: float, end_s: float) -> None:
        flags[channel] = np.where(during(start_s, end_s), flags[channel] & ~bit[name], flags[channel])

    off = np.abs(m.effort_lost["RKN"]) > 0.15
    raise_bit("RKN", "pwmSaturated", STALL_S + 0.35, FREE_S + 0.15)
    raise_bit("RKN", "jam", STALL_S + 0.7, FREE_S + 0.30)
    flags["RKN"] = np.where(off, flags["RKN"] | bit["bigError"], flags["RKN"])
    for channel in ("LSP", "LSR", "LSY", "LEB"):
        raise_bit(channel, "comply", TOUCH_S + 1.6, LEAVE_S + 0.8)
    raise_bit("LSP", "pwmSaturated", TOUCH_S + 0.9, TOUCH_S + 1.6)
    for i in range(1, 6):
        found = HOMING_S[0] + 0.9 + 0.42 * (i - 1) + 0.65
        drop_bit(f"LF{i}", "homed", HOMING_S[0], found)
    drop_bit("RWR", "enabled", 26.2, 32.2)
    return {c: v.astype(np.float64) for c, v in flags.items()}
