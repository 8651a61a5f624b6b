"""Checks what a source or a program publishes against the robot's model. Each kind of problem is counted, and
logged once."""

from __future__ import annotations

import logging
import math
import threading
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import NamedTuple

from posecast_wire.command_line.installation import name_edge_command

from posecast_edge.kit import OnceLog, make_visible, quote
from posecast_edge.model.finding import quote_names
from posecast_edge.model.serve.bundle import Bundle
from posecast_edge.sample import Reading

log = logging.getLogger("posecast_edge.robot")

PROBLEMS_MAX = 50  # kinds that are counted separately
MORE = "further kinds of problems are only counted"


class ProblemList:
    """Counts the problems with published values, and logs each kind once. May be used from any thread. `add`
    never writes; `log_new` writes the log, in a thread that may block."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: dict[str, int] = {}
        self._new: list[str] = []
        self._firsts: dict[str, str] = {}  # the text of a part's first problem

    def add(self, text: str, part: str = "") -> None:
        """Count one more problem of this kind. `text`: one line, the same for each problem of a kind. If it
        shows a value that changes, `part` is what stays the same, and the first text is kept."""
        text = make_visible(text)
        with self._lock:
            if part:
                text = self._firsts.setdefault(part, text)
            if text not in self._counts and len(self._counts) >= PROBLEMS_MAX:
                text = MORE
            if text not in self._counts:
                self._new.append(text)
            self._counts[text] = self._counts.get(text, 0) + 1

    def get_counts(self) -> dict[str, int]:
        """Text of each problem → how often it has occurred, the oldest first."""
        with self._lock:
            return dict(self._counts)

    def log_new(self) -> None:
        """Log the problems that have not been logged yet."""
        if not self._new:
            return
        with self._lock:
            new, self._new = self._new, []
        for text in new:
            log.warning("%s", text)


# --- the model

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
    """Compares published values with the robot's model. Does not read meshes. Reports to `problems`.
    `take_model` may be called from any thread, the other methods from one."""

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


SHOWN = 3  # names of each side
AFFIX_MAX = 40  # characters


def explain_stillness(labels: Collection[str], readings: AbstractSet[str], joints: Sequence[str]) -> str:
    """One line that says that none of the channels `labels` moves the model, and what to do; "" if one does,
    or if there is nothing to move. `readings`: what moves the model, by the names that it may have; `joints`:
    the model's joints."""
    if not labels or not joints or not readings.isdisjoint(labels):
        return ""
    sent, known = (quote_names(list(names), SHOWN) for names in (labels, joints))
    text = f"no channel moves the model: the source sends {sent}, the model's joints are {known}"
    for whose, longer, shorter in (("channels", labels, joints), ("model's joints", joints, labels)):
        if affix := _find_affix(longer, shorter):
            text += f"; the names of the {whose} {affix}"
            break
    return f"{text}; use the same names, or map them in a profile's [joints]"


def _find_affix(longer: Iterable[str], shorter: Iterable[str]) -> str:
    """What most of the longer names have before or behind the shorter ones: `begin with 'r1/'`. "" if there
    is nothing of the kind."""
    known, found, count = frozenset(shorter), Counter[tuple[str, str]](), 0
    for name in longer:
        count += 1
        for i in range(1, min(len(name), AFFIX_MAX)):
            if name[i:] in known and not name[i - 1].isalnum():
                found["begin with", name[:i]] += 1
            if name[:-i] in known and not name[-i].isalnum():
                found["end with", name[-i:]] += 1
    (how, affix), most = max(found.items(), key=lambda item: item[1], default=(("", ""), 0))
    return f"{how} {quote(affix)}" if 2 * most >= min(count, len(known)) > 0 and affix else ""
