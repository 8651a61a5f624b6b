"""Makes `wire/vectors/balance.json`: models, what robots report, and their balance then, as the page must
find it (docs/explanation/balance.md).

The expected values come from elsewhere than the formulas that are tested. Each foot is pushed at points that
are chosen here, so the centre of pressure is the mean of these points and the wrench is their sum at the
sensor. Which feet bear, and why something is null, is written down by hand in each case. The convex hull
tries every pair of points, the margin every edge, and velocities come from whole transforms.
"""

from __future__ import annotations

import json
import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wire.python.tools.balance_course import SENSORS, SOLE, WEIGHT_N, Case, Course, Frame, Push, make_model
from wire.python.tools.balance_geometry import Document


class Luck:
    """Poses and pushes by chance."""

    def __init__(self, seed: str) -> None:
        self._chance = random.Random(seed)

    def near(self, spread: float) -> float:
        return self._chance.uniform(-spread, spread)

    def joints(self, bent: float = 0.25) -> dict[str, float]:
        names = [f"{side}{joint}" for side in "rl" for joint in ("hip", "knee", "ankle")]
        return {"neck": self.near(1), **{name: self.near(bent) for name in names}}

    def push(self, part: float, shear: float = 0.1, corner: int | None = None) -> Push:
        """A part of the weight at three points, or near one corner."""
        points, forces = [], []
        share = [0.2 + self._chance.random() for _ in range(3)]
        for one in share:
            weights = [self._chance.random() for _ in SOLE]
            if corner is not None:
                weights = [0.999 if i == corner else 0.001 / (len(SOLE) - 1) for i in range(len(SOLE))]
            points.append([w / sum(weights) for w in weights])
            n = part * WEIGHT_N * one / sum(share)
            forces.append([self.near(shear) * n, self.near(shear) * n, n])
        return Push(points, forces)


FIRST = {"capture_point": "first-pose"}


def all_gaps(gap: str) -> dict[str, str]:
    """Of a robot that does not stand, for one reason."""
    return dict.fromkeys(("polygon", "margin", "pressure", "capture_point"), gap)


BOTH = {"RF": True, "LF": True}
UNFORCED = {"pressure": "no-wrench"}


def _stands(dice: Luck, n: int, **more: Any) -> list[Frame]:
    frames = []
    for i in range(n):
        pushes = {
            "RF": dice.push(0.55, more.get("shear", 0.1)),
            "LF": dice.push(0.45, more.get("shear", 0.1)),
        }
        joints, at = dice.joints(0.05), ([1 + dice.near(0.02), 2, 0.85], [dice.near(0.05), 0.03, 0.6])
        gaps = {**more.get("gaps", {}), **(FIRST if i == 0 and "gaps" not in more else {})}
        frames.append(Frame(round(i * 0.05, 3), joints, pushes, BOTH, at, gaps=gaps))
    return frames


def _leans(dice: Luck) -> list[Frame]:
    frames = _stands(dice, 4)
    for i, frame in enumerate(frames):
        frame.base = ([1 + 0.1 * i, 2, 0.85], [0.02, 0.12 * i, 0.6])
        frame.pushes = {"RF": dice.push(0.55, corner=2), "LF": dice.push(0.45, corner=1)}
        frame.joints = {**dict.fromkeys(frame.joints, 0.0), "rankle": -0.1 * i, "lankle": -0.1 * i}
    return frames


def _walks(dice: Luck) -> list[Frame]:
    """Parts of the weight on each foot; the feet that bear follow from 5 % and 3 %."""
    course = [(0.9, 0.04), (0.9, 0.06), (0.52, 0.48), (0.04, 0.9), (0.02, 0.9), (0.04, 0.9), (0, 0.02)]
    course += [(0.6, 0), (0.9, 0.04)]
    bears = [(1, 0), (1, 1), (1, 1), (1, 1), (0, 1), (0, 1), (0, 0), (1, 0), (1, 0)]
    frames = []
    for i, ((right, left), (on_right, on_left)) in enumerate(zip(course, bears, strict=True)):
        at = ([0.05 * i, 0, 0.84], [0.01, 0.02, 0.1 * i])
        gaps = dict(FIRST) if i in (0, 7) else all_gaps("airborne") if i == 6 else {}
        pushes = {"RF": dice.push(right), "LF": dice.push(left)}
        known = {"RF": bool(on_right), "LF": bool(on_left)}
        frames.append(Frame(round(i * 0.04, 3), dice.joints(), pushes, known, at, gaps=gaps))
    return frames


def _falls_silent(dice: Luck) -> list[Frame]:
    frames = _stands(dice, 5)
    frames[2].pushes = {"RF": frames[2].pushes["RF"], "LF": None}
    frames[2].bears = {"RF": True, "LF": None}
    frames[2].gaps = all_gaps("unread")
    frames[4].lost = ["RF.mx"]
    frames[4].gaps = {"pressure": "unread"}
    return frames


def _pauses(dice: Luck) -> list[Frame]:
    frames = _stands(dice, 6)
    times = [0.0, 0.75, 1.51, 1.55, 0.4, 0.44]
    for frame, t in zip(frames, times, strict=True):
        frame.t = t
        frame.gaps = dict(FIRST) if t in (0.0, 1.51, 0.4) else {}
    frames[4].pushes = {
        "RF": dice.push(0.9),
        "LF": dice.push(0.04),
    }  # bore before, and that was another time
    frames[4].bears = {"RF": True, "LF": False}
    return frames


def _stands_still(dice: Luck) -> list[Frame]:
    """A frame at the first sample after each 0.5 s, as the edge sends them."""
    (first,) = _stands(dice, 1)
    bent = {**first.joints, "rknee": 0.1, "lknee": 0.1}  # at last it bends its knees
    return [first, replace(first, t=0.533, gaps={}), replace(first, t=1.1, gaps={}, joints=bent)]


def _afoot(dice: Luck) -> list[Frame]:
    """The soles' heights follow from the knees, since the robot has no wrenches."""
    frames = []
    for i, (knee, right, left) in enumerate(
        [(0, 1, 1), (0.1, 1, 1), (0.6, 0, 1), (-0.6, 0, 1), (0.05, 1, 1)]
    ):
        joints = {
            **dict.fromkeys(dice.joints(), 0.0),
            "neck": dice.near(1),
            "rhip": -knee / 2,
            "rknee": knee,
        }
        joints["rankle"] = -knee / 1.6 if abs(knee) > 0.2 else 0.01 - knee / 4
        gaps = {"pressure": "no-wrench"} | (FIRST if i == 0 else {})
        known = {"rsole": bool(right), "lsole": bool(left)}
        frames.append(Frame(round(i * 0.05, 3), joints, {}, known, gaps=gaps))
    return frames


def _turns(dice: Luck) -> list[Frame]:
    frames = _stands(dice, 4)
    for frame in frames:
        frame.base, frame.tilt = None, (dice.near(0.1), dice.near(0.1))
    return frames


def _named(dice: Luck) -> list[Frame]:
    frames = []
    for i in range(3):
        joints = dice.joints(0.005)
        pushes = {"RF": _of_corners(dice.push(0.5), 4), "lfoot": None}
        known = {"RF": True, "lfoot": True}
        gaps = {"pressure": "no-wrench"} | (FIRST if i == 0 else {})
        at = ([0.02 * i, 0, 0.85], [0, 0, 0.3])
        frames.append(Frame(round(i * 0.1, 3), joints, pushes, known, at, gaps=gaps))
    return frames


def _off_the_ground(dice: Luck, gaps: Mapping[str, str]) -> list[Frame]:
    frames = _stands(dice, 1, gaps=gaps)
    for frame in frames:
        frame.bears = {}
        frame.pushes = {}
    return frames


def _lies(dice: Luck) -> list[Frame]:
    """On its back: its soles are upright, and nothing stands on their edges."""
    straight = dict.fromkeys(dice.joints(), 0.0)
    gaps = {**all_gaps("airborne"), "pressure": "no-wrench"}
    base = ([0, 0, 0.1], [0.0, -1.5, 0.0])
    return [Frame(0.0, straight, {}, {"rsole": False, "lsole": False}, base, gaps=gaps)]


def _stands_on_its_head(dice: Luck, pushed: bool = True) -> list[Frame]:
    """Its soles are level, and their outsides look up."""
    frames = _stands(dice, 1)
    for frame in frames:
        frame.base = ([1, 2, 0.85], [0.05, 3.1, 0.6])
        frame.gaps = all_gaps("airborne") | ({} if pushed else UNFORCED)
        frame.pushes = frame.pushes if pushed else {}
        frame.bears = dict.fromkeys(frame.bears if pushed else ("rsole", "lsole"), False)
    return frames


def _kneels(dice: Luck) -> list[Frame]:
    """Its toes point backwards: the outsides of the soles look up though its mass is above them."""
    [frame] = _stands_on_its_head(dice, pushed=False)
    bent = {"rknee": 2.3, "lknee": 2.3}
    frame.joints, frame.base = {**dict.fromkeys(frame.joints, 0.0), **bent}, ([0, 0, 0.45], [0, 0, 0])
    return [frame]


def _loses(frame: Frame, why: str, lost: Sequence[str] = (), zero: Sequence[str] = ()) -> None:
    """Nothing in the world is known of a frame."""
    frame.lost, frame.zero, frame.blind = lost, zero, why
    frame.bears = dict.fromkeys(frame.bears)
    frame.gaps = {"centre_of_mass": why, **all_gaps(why)}


def _loses_its_turn(dice: Luck) -> list[Frame]:
    """A part of the quaternion is lost, later all of it is 0."""
    frames = _stands(dice, 4)
    _loses(frames[1], "orientation-unread", lost=["base.w"])
    _loses(frames[3], "orientation-unread", zero=["base.w", "base.x", "base.y", "base.z"])
    return frames


def _loses_its_tilt(dice: Luck) -> list[Frame]:
    """From the first frame on, then again."""
    frames = _turns(dice)[:3]
    _loses(frames[0], "orientation-unread", lost=["imu.roll", "imu.pitch"])
    frames[1].gaps = dict(FIRST)
    _loses(frames[2], "orientation-unread", lost=["imu.pitch"])
    return frames


def _loses_joints(dice: Luck) -> list[Frame]:
    """A leg is lost, then a joint of the other, then the neck: the head has 3.1 of 41.4 kg."""
    frames = _stands(dice, 4)
    _loses(frames[1], "joint-unread", lost=["lhip", "lknee", "lankle"])
    _loses(frames[2], "joint-unread", lost=["rankle"])
    _loses(frames[3], "joint-unread", lost=["neck"])
    return frames


def _loses_a_light_joint(dice: Luck) -> list[Frame]:
    """The head is light there, and stays as it was."""
    frames = _stands(dice, 2)
    frames[0].joints = {**frames[0].joints, "neck": 0.0}
    frames[1].joints, frames[1].lost = {**frames[1].joints, "neck": 0.0}, ["neck"]
    return frames


def _at_limits(dice: Luck) -> list[Frame]:
    """A moment, then a force at the limit of its code; then a push far outside the sole."""
    frames = _stands(dice, 3)
    frames[0].full, frames[0].gaps = ["RF.mx"], {**FIRST, "pressure": "unread"}
    frames[1].full, frames[1].gaps = ["LF.fz"], all_gaps("unread")
    frames[1].bears = {"RF": True, "LF": None}
    frames[2].pushes = {**frames[2].pushes, "LF": Push([[-4, 5, 0, 0, 0]], [[0, 0, 0.45 * WEIGHT_N]])}
    frames[2].gaps = {"pressure": "unread"}
    return frames


def _unforced_frames(dice: Luck) -> list[Frame]:
    frames = _stands(dice, 1)
    for frame in frames:
        frame.gaps = {**frame.gaps, **UNFORCED}
    return frames


def make_cases() -> list[Case]:
    """All cases."""
    tilted = {**SENSORS, "imu": {"kind": "imu", "name": "imu", "link": "trunk"}}
    turned = {
        "RF": {
            "kind": "wrench",
            "name": "r",
            "link": "rsole",
            "xyz": [0, 0.01, 0.04],
            "rpy": [math.pi, 0, 0.4],
        },
        "LF": {"kind": "wrench", "name": "l", "link": "lfoot", "xyz": [0.01, 0, 0], "rpy": [1.5708, 0, -1.1]},
    }
    own = {"RF": [[-0.1, -0.06, -0.09], [0.15, 0.05, -0.09], [0.15, -0.06, -0.09], [-0.1, 0.05, -0.09]]}
    own["lfoot"] = [[-0.1, -0.05, -0.09], [0.15, -0.05, -0.09], [0.1, 0.06, -0.09]]
    rule = {"feet": ["RF", "lfoot"], "ground": "lowest", "soles": own}

    no_masses = {"centre_of_mass": "no-masses", "margin": "no-masses", "capture_point": "no-masses"}
    cannot_be = dict.fromkeys(no_masses, "impossible-masses")
    old = {**dict.fromkeys(no_masses, "old-bundle"), **dict.fromkeys(("polygon", "pressure"), "old-bundle")}
    nowhere: dict[str, Any] = {"feet": {}, "ground": None}

    right_only = {"RF": SENSORS["RF"]}
    return [
        Case("stands", _stands(Luck("stands"), 2)),
        Case("leans until it would fall", _leans(Luck("leans"))),
        Case("walks: feet bear from 5 % on and until 3 %", _walks(Luck("walks"))),
        Case("sensors are turned, one on the sole's own link", _stands(Luck("turned"), 2), sensors=turned),
        Case("sensors tell the force on the floor", _stands(Luck("sign"), 2), sign=-1),
        Case(
            "sensors measure fz, mx and my",
            _stands(Luck("three"), 1, shear=0.0),
            components=("fz", "mx", "my"),
        ),
        Case("sensors measure force alone", _unforced_frames(Luck("force")), components=("fx", "fy", "fz")),
        Case("forces in kN and one in N, moments in N·mm", _stands(Luck("units"), 2),
             units={"ftf": ("kN", 1e3), "ftf LF.fx": ("N", 1.0), "ftm": ("N·mm", 1e-3)}),
        Case("moments in a unit that nobody knows", _unforced_frames(Luck("foot-pounds")),
             units={"ftf": ("mN", 1e-3), "ftm": ("lbf·ft", 0.0)}),
        Case("a sensor falls silent, then a component", _falls_silent(Luck("silent"))),
        Case("pauses, and goes back in time", _pauses(Luck("pauses"))),
        Case("stands still and sends two frames a second", _stands_still(Luck("still"))),
        Case("has no wrenches", _afoot(Luck("afoot")), ground="lowest", sensors={}, placed_by="",
             feet={"rsole": "rsole", "lsole": "lsole"}),
        Case("knows its tilt alone", _turns(Luck("turns")), sensors=tilted, placed_by="tilt"),
        Case("loses how its body is turned", _loses_its_turn(Luck("base lost"))),
        Case("loses joints", _loses_joints(Luck("joints lost"))),
        Case("loses a joint carrying little", _loses_a_light_joint(Luck("neck lost")), model="light head"),
        Case("loses its tilt", _loses_its_tilt(Luck("tilt lost")), sensors=tilted, placed_by="tilt"),
        Case("its profile has feet and soles", _named(Luck("named")), ground="lowest",
             sensors=right_only, rule=rule, feet={"RF": "rfoot", "lfoot": "lfoot"}, soles=own),
        Case("its profile says it stands on nothing", _off_the_ground(Luck("none"), all_gaps("no-feet")),
             rule={"feet": []}, **nowhere),
        Case("one foot alone has a wrench", _afoot(Luck("one"))[:1], ground="lowest", sensors=right_only,
             placed_by="", feet={"rsole": "rsole", "lsole": "lsole"}),
        Case("lies on its back", _lies(Luck("back")), ground="lowest", sensors={},
             feet={"rsole": "rsole", "lsole": "lsole"}),
        Case("stands on its head", _stands_on_its_head(Luck("head"))),
        Case("stands on its head, without wrenches", _stands_on_its_head(Luck("head"), pushed=False),
             ground="lowest", sensors={}, feet={"rsole": "rsole", "lsole": "lsole"}),
        Case("kneels", _kneels(Luck("kneels")), ground="lowest", sensors={},
             feet={"rsole": "rsole", "lsole": "lsole"}),
        Case("sensors at their limits, a push outside the sole", _at_limits(Luck("limits"))),
        Case("a sole that is none", _off_the_ground(Luck("far"), all_gaps("no-feet")), model="far sole",
             **nowhere),
        Case("its profile names a foot that is not there", _off_the_ground(Luck("x"), all_gaps("no-feet")),
             rule={"feet": ["RF", "XF"]}, **nowhere),
        Case("has masses beyond any robot's", _stands(Luck("vast"), 1, gaps=cannot_be), model="vast mass"),
        Case("has no soles", _off_the_ground(Luck("wheels"), all_gaps("no-feet")), model="no soles",
             **nowhere),
        Case("has no masses", _stands(Luck("no masses"), 1, gaps=no_masses), model="no masses"),
        Case("has masses that can't be", _stands(Luck("bad"), 1, gaps=cannot_be), model="impossible masses"),
        Case("an older bundle", _off_the_ground(Luck("old"), old), model="old", **nowhere),
    ]  # fmt: skip


def _of_corners(push: Push, count: int) -> Push:
    """The same push with points of fewer corners."""
    points = [[w / sum(p[:count]) for w in p[:count]] for p in push.points]
    return Push(points, push.forces)


def make_models() -> dict[str, Document]:
    """What other models have instead, by name; a member that is null is absent."""
    finding = {"severity": "error", "code": "mass-zero", "text": "link trunk: its mass is 0"}
    soles = make_model()["soles"]
    far = [[0, 0, 0], [1e30, 0, 0], [0, 1e30, 0]]
    vast = {"link": 0, "mass_kg": 1e308, "xyz": [0, 0, 0], "inertia": [1, 0, 0, 1, 0, 1]}
    light = [{**each, "mass_kg": 0.3} if each["link"] == 1 else each for each in make_model()["inertials"]]
    return {
        "biped": {},
        "light head": {"inertials": light},
        "no soles": {"soles": []},
        "no masses": {"inertials": []},
        "impossible masses": {"inertials": [], "findings": [finding]},
        "far sole": {"soles": [soles[0], {"link": soles[1]["link"], "points": far}]},
        "vast mass": {"inertials": [vast]},
        "old": {"inertials": None, "soles": None},
    }


def plain(value: Any) -> Any:
    """Without numpy, and rounded to 1 µm."""
    if isinstance(value, Mapping):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(v) for v in value]
    if isinstance(value, (float, np.floating)):
        return round(float(value), 6) + 0.0
    return value


def files() -> dict[str, str]:
    """File name → text."""
    models, model = make_models(), make_model()
    parts = []
    for case in make_cases():
        changes = models[case.model]
        changed = {name: value for name, value in {**model, **changes}.items() if value is not None}
        course = Course(case, changed)
        frames = [plain(course.make(frame)) for frame in case.frames]
        head = {"name": case.name, "changes": changes, "schema": course.schema.text}
        lines = ",\n".join(json.dumps(frame, separators=(",", ":")) for frame in frames)
        parts.append(f'{json.dumps(head)[:-1]}, "frames": [\n{lines}\n]}}')
    shown = json.dumps(model, separators=(",", ":"))
    return {"balance.json": f'{{"model": {shown},\n"cases": [\n' + ",\n".join(parts) + "\n]}\n"}
