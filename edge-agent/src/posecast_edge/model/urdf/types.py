"""A URDF as typed values (wiki.ros.org/urdf/XML): metres, radians, rpy about fixed axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from posecast_edge.model.finding import Finding
from posecast_edge.model.kinematics import Matrix, matrix_from_quaternion, quaternion_from_rpy

SHAPES_MAX = 1024  # visuals; as many collisions

FAR_M = 1e7  # 10,000 km: nothing of a robot lies beyond

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)
ONES: Vector = (1.0, 1.0, 1.0)

SCALAR_TYPES = ("revolute", "continuous", "prismatic")  # one value moves them
AUTO, IGNORE, APPLY = UP_AXIS_MODES = (
    "auto",
    "ignore",
    "apply",
)  # what is done with the up axis of Collada and glTF files
UNBOUNDED = 1e4  # rad or m: a limit that large means none
JOINT_TYPES = (*SCALAR_TYPES, "fixed", "floating", "planar")


@dataclass(frozen=True)
class Pose:
    """parent_from_child: translation and roll, pitch, yaw about fixed axes."""

    xyz: Vector = ZERO
    rpy: Vector = ZERO

    def to_matrix(self) -> Matrix:
        """parent_from_child as a 4 × 4 matrix."""
        return matrix_from_quaternion(self.xyz, quaternion_from_rpy(self.rpy))


@dataclass(frozen=True)
class Geometry:
    """`kind` is mesh, box (x, y, z), cylinder or capsule (radius, length along z) or sphere (radius). `part`:
    of a mesh only what the file calls so, as far as it names parts, "" for all of it; `is_centred`: with the
    middle of its box at the origin."""

    kind: str
    dims: tuple[float, ...]
    uri: str
    scale: Vector
    line: int
    part: str = ""
    is_centred: bool = False


@dataclass(frozen=True)
class Material:
    """`rgba` as display values 0 … 1, None when only named or textured."""

    name: str
    rgba: tuple[float, float, float, float] | None
    texture: str | None
    line: int


@dataclass(frozen=True)
class Shape:
    """A visual or a collision."""

    pose: Pose
    geometry: Geometry | None
    material: Material | None
    line: int


@dataclass(frozen=True)
class Inertial:
    """Mass, kg; `inertia` about the centre of mass: the matrix's ixx, ixy, ixz, iyy, iyz, izz, kg·m², in the
    axes of `pose`, which is link_from_centre."""

    mass: float
    inertia: tuple[float, ...]
    line: int
    pose: Pose = Pose()


@dataclass(frozen=True)
class Link:
    """A link of the robot."""

    name: str
    visuals: tuple[Shape, ...]
    collisions: tuple[Shape, ...]
    inertial: Inertial | None
    line: int


@dataclass(frozen=True)
class Limit:
    """Limits of a joint; None: not given."""

    lower: float | None
    upper: float | None
    velocity: float | None
    effort: float | None
    line: int


@dataclass(frozen=True)
class Mimic:
    """This joint = multiplier × the other + offset."""

    joint: str
    multiplier: float
    offset: float
    line: int


@dataclass(frozen=True)
class Joint:
    """A joint; `axis` as written in the file, None if absent."""

    name: str
    type: str
    parent: str
    child: str
    pose: Pose
    axis: Vector | None
    limit: Limit | None
    mimic: Mimic | None
    line: int


@dataclass(frozen=True)
class Sensor:
    """A sensor that the URDF names, on a link."""

    name: str
    kind: str
    link: str
    pose: Pose
    line: int


@dataclass(frozen=True)
class Reference:
    """A mention of a joint or link in another element: transmission or gazebo."""

    what: str
    name: str
    by: str
    line: int


@dataclass
class Urdf:
    """The content of a URDF. Lists keep the file's order and duplicates."""

    name: str
    links: list[Link] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    materials: dict[str, Material] = field(default_factory=dict)
    sensors: list[Sensor] = field(default_factory=list)
    references: list[Reference] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)


def find_material(shape: Shape, materials: Mapping[str, Material]) -> Material | None:
    """A visual's material: the robot's material of that name, else the one defined in the visual."""
    own = shape.material
    return None if own is None else materials.get(own.name, own)
