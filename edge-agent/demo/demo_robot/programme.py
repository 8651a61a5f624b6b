"""What happens in the minute: where the robot steps, what its arms, head and fingers do. Seconds, radians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from demo_robot.gait import Gait, Keys, Step, plan, stance, track, walk, window
from demo_robot.shapes import Floats

PERIOD_S = 60.0

STRIDE = 0.16  # m a step
STEP_S = 0.80
FORWARD_S, TURN_S, BACK_TURN_S, HOME_S = 4.6, 21.6, 33.4, 46.2
REACH_S, TOUCH_S, LEAVE_S = 25.8, 27.0, 31.6  # the left arm meets an obstacle
LIFT_S, STALL_S, FREE_S = 39.0, 40.1, 43.4  # the right knee jams in the air
DEAD_S = (12.0, 18.5)  # the left foot's IMU gives nothing
LEAN_S = 56.5  # the last finger has found its zero
HOMING_S = (53.2, 57.6)  # the left fingers lose and find their zero
TURN_RAD = 0.9

PHASES: tuple[tuple[float, str], ...] = (
    (0.0, "standing"),
    (FORWARD_S - 0.9, "walking"),
    (10.8, "waving"),
    (16.4, "bowing"),
    (TURN_S - 0.9, "turning"),
    (REACH_S - 0.4, "reaching"),
    (BACK_TURN_S - 0.9, "turning"),
    (LIFT_S - 0.9, "knee test"),
    (HOME_S - 0.9, "walking"),
    (53.0, "homing fingers"),
    (LEAN_S, "leaning"),
    (59.4, "standing"),
)


@dataclass(frozen=True)
class Plan:
    """The whole body over time, before any servo: channels (n,), the pelvis, the gait."""

    t: Floats
    gait: Gait
    upper: dict[str, Floats]  # channels above the waist, and the waist
    height: Floats  # of the hip joints, m
    bow: Floats  # pelvis pitch, rad


def steps() -> list[Step]:
    """Five steps forward and a closing one; a turn to the left and back; a lifted leg; home backwards."""
    far = 5 * STRIDE
    out = walk(FORWARD_S, [(STRIDE * (k + 1), 0.0, 0.0) for k in range(5)], "R", STEP_S)
    left = walk(TURN_S, [(far, 0.0, TURN_RAD * a) for a in (0.34, 0.67, 1.0)], "L", STEP_S)
    right = walk(BACK_TURN_S, [(far, 0.0, TURN_RAD * a) for a in (0.66, 0.33, 0.0)], "R", STEP_S)
    x, y, yaw = stance(far, 0.0, 0.0)["R"]
    lift = [Step("R", LIFT_S, FREE_S + 2.2, x, y, yaw, height=0.0)]  # the height is a curve of its own
    home = walk(HOME_S + 0.9, [(far - STRIDE * (k + 1), 0.0, 0.0) for k in range(5)], "L", STEP_S)
    return [*out, *left, *right, *lift, *home]


# fmt: off
LEG_UP: Keys = ((LIFT_S, 0), (STALL_S + 0.9, 0.21), (FREE_S + 0.6, 0.21), (FREE_S + 2.2, 0))

# Arms by key, the right one mirrored. Zero: hanging, relaxed.
LEFT: dict[str, Keys] = {
    "SP": ((16.6, 0), (17.8, 0.35), (19.2, 0.35), (20.6, 0),
           (REACH_S, 0), (28.6, -1.22), (30.8, -1.22), (32.6, 0),
           (53.0, 0), (54.6, -0.75), (LEAN_S, -0.75), (58.1, 0.22), (58.9, 0.22), (60.0, 0)),
    "SR": ((11.0, 0), (12.0, 0.04), (15.2, 0.04), (16.2, 0),
           (REACH_S, 0), (27.0, -0.12), (31.2, -0.12), (32.6, 0),
           (LIFT_S - 0.6, 0), (40.4, 0.42), (44.6, 0.42), (46.0, 0),
           (53.0, 0), (54.6, -0.05), (57.0, -0.05), (59.0, 0)),
    "SY": ((REACH_S, 0), (27.4, 0.15), (31.0, 0.15), (32.6, 0),
           (53.0, 0), (54.6, 0.25), (57.0, 0.25), (59.0, 0)),
    "EB": ((4.0, 0), (5.0, -0.28), (9.6, -0.28), (10.6, 0),
           (16.6, 0), (17.8, -0.15), (19.2, -0.15), (20.6, 0),
           (REACH_S, 0), (26.8, -0.95), (28.8, -0.28), (30.8, -0.28), (31.8, -0.8), (32.8, 0),
           (LIFT_S - 0.6, 0), (40.4, -0.30), (44.6, -0.30), (46.0, 0),
           (46.6, 0), (47.6, -0.28), (53.0, -0.28), (54.6, -1.25), (LEAN_S, -1.25), (58.4, 0)),
    "WY": ((REACH_S, 0), (27.2, -0.45), (31.2, -0.45), (32.8, 0),
           (53.0, 0), (54.6, -0.9), (57.0, -0.9), (59.0, 0)),
    "WR": ((53.0, 0), (54.6, 0.18), (57.0, 0.18), (59.0, 0)),
    "WP": ((REACH_S, 0), (27.4, -0.22), (31.0, -0.22), (32.6, 0)),
}
RIGHT: dict[str, Keys] = {
    "SP": ((11.0, 0), (12.4, -0.62), (15.0, -0.62), (16.4, 0),
           (16.6, 0), (17.8, 0.35), (19.2, 0.35), (20.6, 0),
           (REACH_S, 0), (27.2, 0.22), (31.0, 0.22), (32.4, 0),
           (LEAN_S, 0), (57.8, 0.22), (58.9, 0.22), (60.0, 0)),
    "SR": ((11.0, 0), (12.4, 0.72), (15.0, 0.72), (16.4, 0),
           (LIFT_S - 0.6, 0), (40.4, 0.30), (44.6, 0.30), (46.0, 0)),
    "SY": ((11.0, 0), (12.4, 0.55), (15.0, 0.55), (16.4, 0)),
    "EB": ((4.0, 0), (5.0, -0.28), (9.6, -0.28), (11.0, -0.1), (12.5, -1.78), (15.0, -1.78), (16.4, 0),
           (16.6, 0), (17.8, -0.15), (19.2, -0.15), (20.6, 0),
           (REACH_S, 0), (27.2, -0.5), (31.0, -0.5), (32.4, 0),
           (LIFT_S - 0.6, 0), (40.4, -0.30), (44.6, -0.30), (46.0, 0),
           (46.6, 0), (47.6, -0.28), (52.2, -0.28), (53.2, 0)),
    "WY": ((11.0, 0), (12.4, 0.85), (15.0, 0.85), (16.4, 0)),
    "WR": ((0, 0),),
    "WP": ((0, 0),),
}
MIRRORED = ("SR", "SY", "WY", "WR")

HEIGHT: Keys = (  # of the hip joints
    (3.2, 0.668), (4.6, 0.654), (9.4, 0.654), (10.8, 0.668),
    (16.6, 0.668), (17.9, 0.650), (19.1, 0.650), (20.6, 0.660),
    (TURN_S, 0.656), (24.4, 0.656), (25.6, 0.666), (32.4, 0.666), (33.4, 0.656), (36.2, 0.656), (38.0, 0.666),
    (46.0, 0.666), (47.0, 0.654), (52.0, 0.654), (53.4, 0.668), (LEAN_S - 0.2, 0.668), (57.7, 0.661),
    (59.0, 0.661), (60.0, 0.668),
)
BOW: Keys = (
    (16.6, 0), (17.9, 0.52), (19.1, 0.52), (20.6, 0), (26.6, 0), (28.4, 0.05), (30.8, 0.05), (32.4, 0),
)

# Leans to its toes until its centre of mass is 15 mm inside the edge of what it stands on, and comes back.
LEAN: Keys = ((LEAN_S, 0), (57.65, 0.1045), (58.95, 0.1045), (59.95, 0))  # how far ahead its feet bear, m
LEAN_PITCH: Keys = ((LEAN_S - 0.2, 0), (57.7, 0.16), (59.0, 0.16), (60.0, 0))  # it turns about its ankles

GAZE: Keys = (  # neck yaw
    (0.3, 0), (1.2, 0.55), (1.8, 0.55), (2.9, -0.5), (3.3, -0.5), (4.2, 0),
    (20.8, 0), (21.6, 0.35), (24.0, 0.05), (32.8, 0), (33.6, -0.35), (36.0, 0),
    (LIFT_S + 0.4, 0), (40.4, -0.22), (44.4, -0.22), (45.6, 0),
    (53.2, 0), (54.2, 0.34), (57.2, 0.34), (58.6, 0),
)
NOD: Keys = (
    (1.2, 0), (1.5, 0.08), (1.9, 0), (11.4, 0), (12.2, -0.06), (15.2, -0.06), (16.2, 0),
    (16.6, 0), (17.9, 0.18), (19.1, 0.18), (20.6, 0), (26.0, 0), (27.2, 0.16), (31.2, 0.16), (32.4, 0),
    (LIFT_S, 0), (40.2, 0.34), (44.4, 0.34), (45.8, 0), (53.2, 0), (54.4, 0.40), (57.2, 0.40),
    (58.2, 0.30), (58.8, 0.30), (59.9, 0),
)
TILT: Keys = (
    (11.6, 0), (12.6, 0.16), (15.0, 0.16), (16.0, 0), (41.4, 0), (42.0, 0.14), (43.2, 0.14), (44.2, 0),
)
# fmt: on


def make(t: Floats) -> Plan:
    """The minute at the instants `t` (equally spaced, the end left out)."""
    gait = plan(t, steps(), track(t, LEAN))
    ahead = _ahead(gait)  # right foot ahead of the left, m
    breath = np.sin(2 * np.pi * t * 15 / PERIOD_S)
    upper: dict[str, Floats] = {
        "WST": -0.42 * ahead + track(t, ((11.2, 0), (12.4, 0.10), (15.0, 0.10), (16.4, 0)))
    }
    upper["WST"] += track(t, ((REACH_S, 0), (28.6, -0.16), (30.8, -0.16), (32.4, 0)))
    nod, tilt = track(t, NOD) + 0.006 * breath, track(t, TILT)
    upper["NKY"] = track(t, GAZE) - 0.8 * upper["WST"]
    upper["NK1"], upper["NK2"] = nod - tilt, nod + tilt  # see robot.mapping
    for side, keys, sign in (("L", LEFT, 1), ("R", RIGHT, -1)):
        for joint, own in keys.items():
            upper[side + joint] = (sign if joint in MIRRORED else 1) * track(t, own)
        upper[f"{side}SP"] += -sign * 1.25 * ahead + 0.010 * breath
        upper[f"{side}SR"] += sign * 0.012 * breath
    wave = window(t, 12.3, 15.2, 0.5) * np.sin(2 * np.pi * 1.25 * (t - 12.3))
    upper["RSY"] += 0.34 * wave
    upper["RWR"] += 0.16 * wave
    _fingers(t, upper)
    height = track(t, HEIGHT) + 0.0015 * breath
    return Plan(t, gait, upper, height, track(t, BOW) + track(t, LEAN_PITCH))


def sole_height(t: Floats) -> Floats:
    """Of the lifted leg, m."""
    return track(t, LEG_UP)


def _ahead(gait: Gait) -> Floats:
    left, right = gait.feet["L"], gait.feet["R"]
    yaw = (left.yaw + right.yaw) / 2
    return (right.x - left.x) * np.cos(yaw) + (right.y - left.y) * np.sin(yaw)


def _fingers(t: Floats, upper: dict[str, Floats]) -> None:
    """Half closed at rest; the waving hand opens, the reaching one is a fist, homing goes one by one."""
    for i in range(1, 6):
        rest = 0.30 + 0.03 * i if i > 1 else 0.22
        lag = 0.06 * i
        opened = ((11.6 + lag, 0.0), (12.4 + lag, -rest), (15.0 + lag, -rest), (16.0 + lag, 0.0))
        upper[f"RF{i}"] = rest + track(t, opened)
        fist = 1.12 if i > 1 else 0.75
        closed = ((26.0 + lag, 0.0), (26.9 + lag, fist - rest), (31.6 + lag, fist - rest), (32.4 + lag, 0.0))
        start = HOMING_S[0] + 0.9 + 0.42 * (i - 1)
        homing = ((start, 0.0), (start + 0.6, 1.05 - rest), (start + 0.7, 1.05 - rest), (start + 1.3, 0.0))
        upper[f"LF{i}"] = rest + track(t, closed) + track(t, homing)
