"""Compares published values with the robot's model. Does not read meshes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from posecast_wire.command_line.installation import name_edge_command

from posecast_edge.kit import OnceLog, quote
from posecast_edge.model.serve.bundle import Bundle
from posecast_edge.sample import Reading
from posecast_edge.sources.published.problems import ProblemList

ERRORS_MAX = 10  # errors of one model that are reported one by one
POSITIONS = ("pos", "ref")
FAR = 3.0  # times the larger limit, or LEAST: anything beyond is no overshoot
LEAST = 0.1  # rad or m
SLACK = 0.02  # rad or m


class JointLimits(NamedTuple):
    """The range of a joint, rad, or m if it slides; `lower` is below `upper`."""

    slides: bool
    lower: float
    upper: float

    def __str__(self) -> str:
        return f"{self.lower:.3g} to {self.upper:.3g} {'m' if self.slides else 'rad'}"

    def is_far(self, reading: float) -> bool:
        """Whether a reading is beyond any overshoot or encoder offset."""
        return abs(reading) > FAR * max(abs(self.lower), abs(self.upper), LEAST)

    def suspect_unit(self, reading: float) -> str:
        """The question whether the reading is in another unit, if it would then fit; otherwise ""."""
        factor, other = (1e-3, "millimetres") if self.slides else (math.pi / 180, "degrees")
        fits = self.lower - SLACK <= reading * factor <= self.upper + SLACK
        return f": are these {other}?" if fits else ""


class ModelCheck:
    """Reports to `problems`. `take_model` may be called from any thread, the other methods from one."""

    def __init__(self, problems: ProblemList) -> None:
        self._problems = problems
        self._readings: frozenset[str] | None = None
        self._limits: Mapping[str, JointLimits] = {}
        self._once = OnceLog(problems.add)
        self._doubts: dict[str, str] = {}  # question → message about the first joint

    def take_model(self, bundle: Bundle) -> None:
        """Compare with this model from now on. Reports each of its errors once; the built model may have more
        errors than the URDF."""
        errors = [f for f in bundle.findings if f.severity == "error"]
        for finding in errors[:ERRORS_MAX]:
            where = f"line {finding.line}: " if finding.line else ""
            self._report_once(f"model: {where}{finding.text}")
        if len(errors) > ERRORS_MAX:
            self._report_once(
                f"model: it has further errors; `{name_edge_command('doctor')} --urdf` lists them"
            )
        self._limits = {
            j.name: JointLimits(j.slides, j.lower, j.upper)
            for j in bundle.joints
            if j.lower is not None and j.upper is not None and j.lower < j.upper
        }
        self._readings = bundle.readings

    def check_names(self, labels: Mapping[str, frozenset[str]]) -> None:
        """Report labels that move nothing. `labels`: field of joints → labels."""
        if self._readings is None:
            return
        for name in sorted(labels):
            for label in sorted(labels[name] - self._readings):
                self._report_once(f"{name} of {quote(label)} moves nothing: the model has no such joint")

    def check_positions(self, values: Mapping[str, Mapping[str, Reading]]) -> None:
        """Report a value far beyond a joint's limits, only for the first of many joints: if a program passes
        degrees as radians, all joints are affected."""
        for name in POSITIONS:
            for label, reading in values.get(name, {}).items():
                limits = self._limits.get(label)
                if limits is not None and type(reading) is float and limits.is_far(reading):
                    self._doubt(f"{name} of {quote(label)}", limits, reading)

    def _doubt(self, what: str, limits: JointLimits, reading: float) -> None:
        question = limits.suspect_unit(reading)
        text = f"{what} is far beyond the joint's limits, {limits}{question}"
        self._problems.add(self._doubts.setdefault(question or text, text))

    def _report_once(self, text: str) -> None:
        self._once.add(text, text)
