"""Whether a screen told the truth: compares its words and poses with the robot's pose at that time.

The robot's pose encodes the time (`robot.py`), so the age of what a screen shows can be read from the pose
itself, whatever statuses, timestamps and numbers say.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from tests.faults.robot import told_s

CLAIMS = ("LIVE", "HOLDING")  # that what is shown is so; the other words claim nothing of it
STALE_S = 1.5  # a screen may take the newest pose for live so long
ON_ITS_WAY_S = 1.0  # from the joint to the screen, on a machine that does much else
HOLDING_S = 3.0
ROUNDING_S = 0.1  # of a hand that is told in steps of 0.001 rad, beside hysteresis


@dataclass(frozen=True)
class Stand:
    """The robot stood still, according to itself; `to_s` is infinite while it does."""

    from_s: float
    to_s: float


def stands(orders: Iterable[dict[str, Any]]) -> list[Stand]:
    """When a robot stood still, from its confirmations of commands."""
    found: list[Stand] = []
    for order in orders:
        if order["order"] == "stand":
            found.append(Stand(order["at"], float("inf")))
        elif order["order"] == "go" and found:
            found[-1] = Stand(found[-1].from_s, order["at"])
    return found


@dataclass(frozen=True)
class Shown:
    """What a screen showed from one moment to another.

    `otherwise_s`: when it last stopped claiming that its picture is true, −inf if it never did.
    """

    word: str
    from_s: float
    to_s: float
    otherwise_s: float
    pose: Sequence[float] | None

    def lie(self, known: Iterable[Stand]) -> tuple[str, float] | None:
        """What is wrong with it, and the age of its pose, s; None: it is true."""
        if self.word not in CLAIMS:
            return None
        if self.pose is None:
            return f"{self.word} without a pose", float("inf")
        told = told_s(self.pose[0], self.pose[1], self.to_s)
        stood = next((one for one in known if abs(one.from_s - told) < ROUNDING_S), None)
        true_until_s = told if stood is None else stood.to_s
        old_s = self.to_s - true_until_s
        if old_s > STALE_S + ON_ITS_WAY_S:
            return f"{self.word} with an old pose", old_s
        if true_until_s < self.otherwise_s - ON_ITS_WAY_S:
            return f"{self.word} again with a pose from before it said otherwise", old_s
        if self.word == "HOLDING" and (stood is None or self.from_s - stood.from_s < HOLDING_S - ROUNDING_S):
            return "HOLDING while the robot moved", old_s
        return None


def shown(said: Sequence[dict[str, Any]], until_s: float) -> Iterator[Shown]:
    """What the screen showed, piece by piece. Times when its machine blocked it are left out."""
    word: str | None = None
    otherwise_s = float("-inf")
    pose: Sequence[float] | None = None
    for line, following in pairwise([*said, {"at": until_s, "held_up_s": 0.0}]):
        if "word" in line:
            if line["word"] not in (None, *CLAIMS) and word in (None, *CLAIMS):
                otherwise_s = line["at"]
            word = line["word"]
        elif "pose" in line:
            pose = line["pose"]
        to_s = following["at"] - following.get("held_up_s", 0.0)
        if word is not None and to_s > line["at"]:
            yield Shown(word, line["at"], to_s, otherwise_s, pose)


def steps_back(frames: Sequence[dict[str, Any]]) -> list[str]:
    """Frames with a pose older than that of the previously shown frame, whatever their numbers say."""
    told = [(frame["seq"], told_s(frame["pose"][0], frame["pose"][1], frame["at"])) for frame in frames]
    return [
        f"seq {seq} is {before_s - at_s:.1f} s older than seq {before}, shown before it"
        for (before, before_s), (seq, at_s) in pairwise(told)
        if at_s < before_s - ROUNDING_S
    ]


def lies(said: Sequence[dict[str, Any]], known: Sequence[Stand], until_s: float) -> list[str]:
    """All false claims of a screen: each kind once, with the oldest pose."""
    oldest_s: dict[str, float] = {}
    for piece in shown(said, until_s):
        lie = piece.lie(known)
        if lie is not None:
            oldest_s[lie[0]] = max(lie[1], oldest_s.get(lie[0], lie[1]))
    return [f"{what}, {old_s:.1f} s" for what, old_s in oldest_s.items()]
