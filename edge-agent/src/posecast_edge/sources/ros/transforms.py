"""Computes the pose of the robot's base from the tree of transforms (/tf, /tf_static). Pure: time is an
argument.

A profile's `[ros] base = "odom→base_link"` names the two frames. The transforms between them may come in any
number of messages, from any number of publishers; the newest of each is used. A new pose is made when the
moving transform nearest to the base is updated, so a base with silent odometry does not look still.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from posecast_edge.kit import OnceLog
from posecast_edge.sources.ros.messages import Report, Transform

FRAMES_MAX = 2048  # of one tree, about a megabyte; further ones are ignored
OLD_S = 60.0  # a moving transform without an update for this long expires
WAIT_S = 5.0  # a missing frame is logged this long after the first transform
SHOWN = 12  # frames named in one line
LINES_MAX = 40
FIXED = ("odom", "map", "world")  # usual names of the fixed frame, the smoothest first
BASES = ("base_footprint", "base_link", "pelvis", "base", "torso", "trunk", "body")

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # w x y z
Pose = tuple[Vector, Quaternion]

NO_MOVE: Pose = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


@dataclass(frozen=True)
class _Edge:
    """The last transform of one frame. `heard_s`: when it arrived."""

    transform: Transform
    static: bool
    heard_s: float


class TransformTree:
    """The frames of one robot. `base`: the two wanted frames; None to only list frames. `say` is called with
    a line for each problem."""

    def __init__(self, base: tuple[str, str] | None, say: Callable[[str], None]) -> None:
        self._base = base
        self._edges: dict[str, _Edge] = {}  # by child
        self._began_s: float | None = None
        self._chain: tuple[list[str], list[str]] | None = None  # see _find_chain
        self._known = False  # whether the chain is up to date
        self._once = OnceLog(say)

    def take_transforms(self, transforms: Sequence[Transform], static: bool, now_s: float) -> Report | None:
        """Take the transforms of one message. Returns the pose of the base if it was updated."""
        if self._began_s is None:
            self._began_s = now_s
        news: set[str] = set()
        for transform in transforms:
            before = self._edges.get(transform.child)
            if before is None and len(self._edges) >= FRAMES_MAX:
                self._once.add(
                    f"more than {FRAMES_MAX} frames: {transform.child} and further ones are left out"
                )
                continue
            if before is None or before.transform.parent != transform.parent:
                self._known = False
            self._edges[transform.child] = _Edge(transform, static, now_s)
            news.add(transform.child)
        return None if self._base is None else self._report(news, now_s)

    def check_time(self, now_s: float) -> None:
        """Log what is missing after a waiting time. Call it regularly."""
        if self._base and self._began_s is not None and now_s - self._began_s >= WAIT_S:
            self.explain_missing()

    def explain_missing(self) -> None:
        """Log once why the base has no pose, if it has none."""
        if self._base is None or self._find_chain() is not None:
            return
        fixed, base = self._base
        frames = self._edges.keys() | {edge.transform.parent for edge in self._edges.values()}
        shown = ", ".join(sorted(frames)[:SHOWN]) + (", …" if len(frames) > SHOWN else "")
        for name in (fixed, base):
            circle = self._find_circle(name)
            if name not in frames:
                self._once.add(f"base {fixed}→{base}: no transform names {name}; frames: {shown or 'none'}")
                return
            if circle:
                self._once.add(f"base {fixed}→{base}: the transforms form a loop: {circle}")
                return
        self._once.add(f"base {fixed}→{base}: no transforms connect the two")

    def list_frames(self, is_link: Callable[[str], bool] = lambda _: False) -> list[str]:
        """Lines for `probe`: the parent and children of each frame, and the profile line that sets the base.
        `is_link`: whether a joint of the robot moves a frame, so that it can't be the base."""
        children: dict[str, list[str]] = {}
        for child, edge in sorted(self._edges.copy().items()):
            children.setdefault(edge.transform.parent, []).append(
                child + (" (static)" if edge.static else "")
            )
        lines = [
            f"frame {parent} → {', '.join(names[:SHOWN])}{', …' if len(names) > SHOWN else ''}"
            for parent, names in sorted(children.items())
        ]
        if len(lines) > LINES_MAX:
            lines[LINES_MAX:] = [f"and {len(lines) - LINES_MAX} more frames with children"]
        found = self._suggest()
        if found and not is_link(found[1]):
            lines.append(f'to show where the robot is, in a profile: [ros] base = "{found[0]}→{found[1]}"')
        return lines

    # --- the chain

    def _report(self, news: set[str], now_s: float) -> Report | None:
        chain = self._find_chain()
        if chain is None:
            return None
        up, down = chain
        moving = [child for child in (*down, *reversed(up)) if not self._edges[child].static]
        if news.isdisjoint(moving[:1] or (*up, *down)):
            return None
        old = [child for child in moving if now_s - self._edges[child].heard_s > OLD_S]
        if old:
            self._once.add(f"no transform of {old[0]} for {OLD_S:g} s: the base has no pose")
            return None
        pose = NO_MOVE
        for child in up:
            pose = multiply_poses(pose, invert_pose(self._pose(child)))
        for child in reversed(down):
            pose = multiply_poses(pose, self._pose(child))
        (x, y, z), (w, qx, qy, qz) = pose
        values = {
            "base": {"base.x": x, "base.y": y, "base.z": z},
            "baseq": {"base.w": w, "base.x": qx, "base.y": qy, "base.z": qz},
        }
        stamp_s = self._edges[moving[0]].transform.stamp_s if moving else None
        return Report(stamp_s, values, lasts=not moving)

    def _pose(self, child: str) -> Pose:
        transform = self._edges[child].transform
        return transform.xyz, transform.wxyz

    def _find_chain(self) -> tuple[list[str], list[str]] | None:
        """Children up to the nearest common parent: those from the fixed frame, and those from the base."""
        if not self._known and self._base is not None:
            self._known = True
            fixed, base = (self._list_ancestry(name) for name in self._base)
            places = {name: i for i, name in enumerate(fixed)}
            meets = next((i for i, name in enumerate(base) if name in places), None)
            self._chain = None if meets is None else (fixed[: places[base[meets]]], base[:meets])
        return self._chain

    def _list_ancestry(self, name: str) -> list[str]:
        """The frame and its ancestors, up to the root or to the point where they form a loop."""
        ancestry = {name: None}
        while (edge := self._edges.get(name)) is not None and edge.transform.parent not in ancestry:
            name = edge.transform.parent
            ancestry[name] = None
        return list(ancestry)

    def _find_circle(self, name: str) -> str:
        """`a → b → a`; "" when this frame's ancestors form no loop."""
        ancestry = self._list_ancestry(name)
        edge = self._edges.get(ancestry[-1])
        if edge is None:
            return ""
        shown = ancestry[ancestry.index(edge.transform.parent) :]
        return " → ".join((*shown[:SHOWN], *(("…",) if len(shown) > SHOWN else ()), shown[0]))

    def _suggest(self) -> tuple[str, str] | None:
        names = {name.rpartition("/")[2]: name for name in sorted(self._edges, reverse=True)}
        for base in (names[last] for last in BASES if last in names):
            above = self._list_ancestry(base)[1:]
            fixed = [name for last in FIXED for name in above if name.rpartition("/")[2] == last]
            if above:
                return (fixed or above[-1:])[0], base
        if any(edge.transform.parent.rpartition("/")[2] in BASES for edge in self._edges.copy().values()):
            return None  # the base is the root, so its pose is unknown
        moving = [(edge.transform.parent, child) for child, edge in self._edges.items() if not edge.static]
        return next((pair for pair in moving if pair[0] not in self._edges), None)


def multiply_poses(first: Pose, second: Pose) -> Pose:
    """The pose `second` in the frame of `first`, its parent. Lengths in metres, unit quaternions w x y z."""
    (x, y, z), q = first
    dx, dy, dz = rotate_vector(q, second[0])
    return (x + dx, y + dy, z + dz), multiply_quaternions(q, second[1])


def invert_pose(pose: Pose) -> Pose:
    """The parent's pose in the frame of its child."""
    w, x, y, z = pose[1]
    back = (w, -x, -y, -z)
    dx, dy, dz = rotate_vector(back, pose[0])
    return (-dx, -dy, -dz), back


def multiply_quaternions(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation by `b`, then by `a`."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def rotate_vector(q: Quaternion, v: Sequence[float]) -> Vector:
    """Rotate a vector by a unit quaternion."""
    w, x, y, z = q
    _, rx, ry, rz = multiply_quaternions(multiply_quaternions(q, (0.0, v[0], v[1], v[2])), (w, -x, -y, -z))
    return rx, ry, rz
