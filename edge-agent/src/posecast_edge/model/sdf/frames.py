"""Resolves the poses of an SDF: each is relative to a frame that the file names, or to a default one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from posecast_edge.model.finding import quote_name
from posecast_edge.model.kinematics import Matrix, identity, multiply
from posecast_edge.model.urdf.types import Pose, Vector
from posecast_edge.model.urdf.xml_tree import Element

WORLD = "::world"  # no name of a file begins so
EXACT = 1e-12  # of a cosine: nearer to 0 roll and yaw turn about one axis


class NoSuchFrame(Exception):
    """A frame that does not exist, or depends on itself. The message is one line."""


@dataclass(frozen=True)
class Frame:
    """`base_from_frame` is relative to the frame `base`. `attached`: the frame that it moves with, a link's
    own name for itself; None for that of a model without links."""

    base: str
    base_from_frame: Matrix
    attached: str | None = None


@dataclass(frozen=True)
class Scope:
    """Where a model's names count: `names` stands before those of its parts, `own` is its own frame;
    `has_world`: it calls a link of its own `world`."""

    names: str
    own: str
    has_world: bool = False

    def name_frame(self, name: str) -> str:
        """The full name of a frame that the model speaks of."""
        if name == "__model__":
            return self.own
        if name == "__root__" or (name == "world" and not self.has_world):
            return WORLD
        return self.names + name

    def find_base(self, pose: Element | None, default: str) -> str:
        """The frame that a `<pose>` is relative to."""
        given = (pose.get("relative_to") or pose.get("frame") or "") if pose is not None else ""
        return self.name_frame(given) if given else default


class FrameGraph:
    """All frames of a file by their full names, `outer::inner::name`. Each is followed once, whoever asks."""

    def __init__(self) -> None:
        self._frames: dict[str, Frame] = {WORLD: Frame("", identity(), WORLD)}
        self._poses: dict[str, Matrix | str] = {WORLD: identity()}  # or why there is none
        self._links: dict[str, str | None] = {}

    def add(self, name: str, frame: Frame) -> bool:
        """Define a frame; False when there is one of that name already."""
        return self._frames.setdefault(name, frame) is frame

    def replace_pose(self, name: str, base_from_frame: Matrix) -> None:
        """Move a frame that nobody has asked for yet."""
        frame = self._frames[name]
        self._frames[name] = Frame(frame.base, base_from_frame, frame.attached)

    def find_pose(self, name: str) -> Matrix:
        """world_from_frame with every joint at zero. Raises NoSuchFrame."""
        chain: dict[str, Frame] = {}
        at = name
        while at not in self._poses:
            if at in chain:
                self._poses[at] = f"its pose depends on itself, through {quote_name(at)}"
            elif at not in self._frames:
                self._poses[at] = f"its pose is relative to {quote_name(at)}, which does not exist"
            else:
                chain[at] = self._frames[at]
                at = chain[at].base
        found = self._poses[at]
        for one, frame in reversed(chain.items()):
            found = found if isinstance(found, str) else multiply(found, frame.base_from_frame)
            self._poses[one] = found
        if isinstance(found, str):
            raise NoSuchFrame(found)
        return found

    def find_pose_inside(self, name: str, outer: str) -> Matrix:
        """outer_from_frame for a frame whose poses lead to `outer`. Raises NoSuchFrame."""
        found, seen = identity(), set[str]()
        while name != outer:
            if name in seen or name not in self._frames:
                raise NoSuchFrame(f"{quote_name(name)} is not a frame inside it")
            seen.add(name)
            found = multiply(self._frames[name].base_from_frame, found)
            name = self._frames[name].base
        return found

    def find_link(self, name: str) -> str:
        """The link that a frame moves with, or the world. Raises NoSuchFrame."""
        chain: dict[str, None] = {}
        at: str | None = name
        while at is not None and at not in self._links:
            frame = self._frames.get(at)
            if frame is None or at in chain:
                at = None
            elif frame.attached == at:
                self._links[at] = at
            else:
                chain[at] = None
                at = frame.attached
        found = self._links[at] if at is not None else None
        self._links |= dict.fromkeys(chain, found)
        if found is None:
            raise NoSuchFrame(f"there is no link {quote_name(name)}")
        return found


def invert_transform(a_from_b: Matrix) -> Matrix:
    """b_from_a of a rotation and a translation."""
    turned = [[a_from_b[j][i] for j in range(3)] for i in range(3)]
    moved = [-sum(turned[i][k] * a_from_b[k][3] for k in range(3)) for i in range(3)]
    return [[*turned[i], moved[i]] for i in range(3)] + [[0.0, 0.0, 0.0, 1.0]]


def rotate_vector(a_from_b: Matrix, vector: Sequence[float]) -> Vector:
    """A direction of b in a."""
    x, y, z = (sum(a_from_b[i][k] * vector[k] for k in range(3)) for i in range(3))
    return (x, y, z)


def make_pose(transform: Matrix) -> Pose:
    """The pose of a transform."""
    xyz = (transform[0][3], transform[1][3], transform[2][3])
    cosine = math.hypot(transform[0][0], transform[1][0])
    pitch = math.atan2(-transform[2][0], cosine)
    if cosine < EXACT:
        return Pose(xyz, (math.atan2(-transform[1][2], transform[1][1]), pitch, 0.0))
    roll = math.atan2(transform[2][1], transform[2][2])
    return Pose(xyz, (roll, pitch, math.atan2(transform[1][0], transform[0][0])))


def is_identity(transform: Matrix, within: float = 1e-12) -> bool:
    """Whether it moves nothing."""
    return all(abs(transform[i][j] - float(i == j)) <= within for i in range(3) for j in range(4))
