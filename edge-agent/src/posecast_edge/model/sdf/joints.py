"""Reads the joints of an SDF, and connects its links to a tree.

In an SDF each joint names two links, which have their own poses. A tree of them may need a joint reversed.
A joint that would close a loop is left out, because a URDF can't express it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from posecast_edge.model.finding import Finding, quote_name
from posecast_edge.model.kinematics import Matrix, identity, multiply
from posecast_edge.model.sdf.frames import (
    WORLD,
    Frame,
    FrameGraph,
    NoSuchFrame,
    Scope,
    invert_transform,
    is_identity,
    make_pose,
    rotate_vector,
)
from posecast_edge.model.sdf.values import SdfValues, get_flag, get_text
from posecast_edge.model.urdf.types import UNBOUNDED, Joint, Limit, Link, Mimic, Vector
from posecast_edge.model.urdf.xml_tree import Element

KINDS = {
    **{kind: kind for kind in ("revolute", "continuous", "prismatic", "fixed")},
    "universal": "revolute",
    "revolute2": "revolute",
    "screw": "revolute",
    "ball": "floating",
}
TWO_AXES = ("universal", "revolute2")
LAST = ("ball", "gearbox")  # these usually close a loop, so they are the ones to leave out
NO_LIMIT = 1e16
OLD_AXIS = (1, 5)  # before this version an axis was given in the model's frame


@dataclass(frozen=True)
class Axis:
    """An axis of a joint: its direction in the frame `frame`."""

    direction: Vector
    frame: str
    limit: Limit
    mimic: Mimic | None


@dataclass(frozen=True)
class JointDraft:
    """A joint as the file has it. `parent`, `child`: frames; `frame`: the joint's own; `kind`: SDF's."""

    name: str
    kind: str
    parent: str
    child: str
    frame: str
    axes: tuple[Axis, ...]
    line: int


class JointReader:
    """Reads `<joint>`, and adds its frame to the graph."""

    def __init__(self, values: SdfValues, frames: FrameGraph) -> None:
        self._values, self._frames = values, frames
        self._names: set[str] = set()

    def read(self, element: Element, scope: Scope, version: tuple[int, ...]) -> JointDraft | None:
        """A joint of a model; None when it can't be used."""
        name = self._values.read_name(element, "joint")
        if name is None:
            return None
        full, what = scope.names + name, f"joint {quote_name(scope.names + name)}"
        if full in self._names:
            text = f"{what} is defined twice; the first is used"
            self._values.note("error", "joint-doubled", text, element)
            return None
        self._names.add(full)
        ends = [get_text(element, end) for end in ("parent", "child")]
        for end, found in zip(("parent", "child"), ends, strict=True):
            if not found:
                self._values.note("error", "joint-ends", f"{what}: no {end} link; left out", element)
                return None
        parent, child = (scope.name_frame(end) for end in ends)
        pose = element.find_first("pose")
        frame = Frame(scope.find_base(pose, child), self._values.read_pose(pose, what), child)
        key = full if self._frames.add(full, frame) else f"{full}//joint"  # a link may have the same name
        if key != full:
            self._frames.add(key, frame)
        tags = ("axis", "axis2") if element.get("type") in TWO_AXES else ("axis",)
        axes = tuple(self._axis(element.find_first(t), scope, key, version, what) for t in tags)
        kind = element.get("type") or ""
        self._say(kind, what, full, element)
        return JointDraft(full, kind, parent, child, key, axes, element.line)

    def _say(self, kind: str, what: str, full: str, element: Element) -> None:
        if kind in TWO_AXES:
            text = f"{what} is {kind}: its channels are {quote_name(full)}, {quote_name(full + '/axis2')}"
            self._values.note("hint", "joint-two-axes", text, element)
        elif kind == "screw":
            self._values.note("hint", "joint-screw", f"{what} is a screw: only its turning is shown", element)
        elif kind == "gearbox":
            text = f"{what} is a gearbox: the body follows what is reported of each joint, not this"
            self._values.note("hint", "joint-gearbox", text, element)
        elif kind not in KINDS:
            text = f"{what}: unknown type {quote_name(kind)}" if kind else f"{what}: no type"
            self._values.note("error", "joint-type", f"{text}; shown as fixed", element)

    def _axis(
        self, axis: Element | None, scope: Scope, key: str, version: tuple[int, ...], what: str
    ) -> Axis:
        xyz = axis.find_first("xyz") if axis is not None else None
        frame = key
        if get_flag(axis, "use_parent_model_frame") or version < OLD_AXIS:
            frame = scope.own
        elif xyz is not None and (given := xyz.get("expressed_in")):
            frame = scope.name_frame(given)
        direction = self._values.read_vector(xyz, (0.0, 0.0, 1.0), what)
        if not any(direction):
            self._values.note(
                "error", "axis-zero", f"{what}: its axis is 0 0 0; read as 0 0 1", xyz or axis or _NONE
            )
            direction = (0.0, 0.0, 1.0)
        return Axis(direction, frame, self._limit(axis, what), self._mimic(axis, scope, what))

    def _limit(self, axis: Element | None, what: str) -> Limit:
        limit = axis.find_first("limit") if axis is not None else None
        lower, upper, velocity, effort = (
            self._values.read_number(limit.find_first(tag), what) if limit is not None else None
            for tag in ("lower", "upper", "velocity", "effort")
        )
        return Limit(
            -NO_LIMIT if lower is None else lower,
            NO_LIMIT if upper is None else upper,
            velocity if velocity is not None and 0 <= velocity < NO_LIMIT else None,
            effort if effort is not None and 0 <= effort < NO_LIMIT else None,
            limit.line if limit is not None else 0,
        )

    def _mimic(self, axis: Element | None, scope: Scope, what: str) -> Mimic | None:
        mimic = axis.find_first("mimic") if axis is not None else None
        if mimic is None:
            return None
        multiplier, offset, reference = (
            self._values.read_number(mimic.find_first(tag), what)
            for tag in ("multiplier", "offset", "reference")
        )
        factor = 1.0 if multiplier is None else multiplier
        shift = (offset or 0.0) - factor * (reference or 0.0)
        return Mimic(scope.names + (mimic.get("joint") or ""), factor, shift, mimic.line)


_NONE = Element("", {}, 0)


def hang_links(
    links: Sequence[Link], drafts: Sequence[JointDraft], frames: FrameGraph, findings: list[Finding]
) -> tuple[list[Link], list[Joint]]:
    """Connect the links to one tree, as they stand with every joint at zero."""
    return _Hanging(links, drafts, frames, findings).hang()


@dataclass(frozen=True)
class _Edge:
    """A joint between two links. `parent_from_joint`, `child_from_joint`: where it is in them."""

    draft: JointDraft
    parent: str
    child: str


class _Hanging:
    def __init__(
        self, links: Sequence[Link], drafts: Sequence[JointDraft], frames: FrameGraph, findings: list[Finding]
    ) -> None:
        self._frames, self._findings = frames, findings
        self._given = {link.name: link for link in links}
        self._group = {name: name for name in (*self._given, WORLD)}
        self._edges: dict[str, list[_Edge]] = {}
        self._links: list[Link] = []
        self._joints: list[Joint] = []
        self._joint_names = {draft.name for draft in drafts}
        self._placed: dict[str, Matrix] = {WORLD: identity()}
        self._world = ""  # the name of the link that stands for it
        held: set[str] = set()
        for draft in sorted(drafts, key=lambda d: d.kind in LAST):
            if (edge := self._connect(draft)) is not None:
                held.add(edge.child)
        self._roots = self._find_roots(links, held)

    def _note(self, severity: str, code: str, text: str, line: int | None) -> None:
        self._findings.append(Finding(severity, code, text, line))

    def _connect(self, draft: JointDraft) -> _Edge | None:
        what = f"joint {quote_name(draft.name)}"
        try:
            parent, child = self._frames.find_link(draft.parent), self._frames.find_link(draft.child)
            self._frames.find_pose(draft.frame)
        except NoSuchFrame as e:
            self._note("error", "joint-ends", f"{what}: {e}; left out", draft.line)
            return None
        if parent not in self._group or child not in self._group:
            self._note("error", "joint-ends", f"{what}: left out, because one of its links is", draft.line)
            return None
        ends = self._find_group(parent), self._find_group(child)
        if ends[0] == ends[1]:
            if draft.kind != "gearbox":
                text = f"{what} closes a loop: {quote_name(parent)} and {quote_name(child)} may part there"
                self._note("warning", "loop-cut", text, draft.line)
            return None
        self._group[ends[1]] = ends[0]
        edge = _Edge(draft, parent, child)
        for link in (parent, child):
            self._edges.setdefault(link, []).append(edge)
        return edge

    def _find_group(self, name: str) -> str:
        while self._group[name] != name:
            self._group[name] = self._group[self._group[name]]
            name = self._group[name]
        return name

    def _find_roots(self, links: Sequence[Link], held: set[str]) -> list[str]:
        """One link of each part that hangs together: the world, else the first that no joint holds."""
        roots: dict[str, str] = {self._find_group(WORLD): WORLD} if WORLD in self._edges else {}
        for free in (True, False):
            for link in links:
                if (link.name not in held) is free:
                    roots.setdefault(self._find_group(link.name), link.name)
        return list(roots.values())

    def hang(self) -> tuple[list[Link], list[Joint]]:
        roots = self._roots
        for root in roots:
            self._pose(root)
        if len(roots) == 1 and roots[0] != WORLD:
            self._links.append(self._given[roots[0]])
            self._walk(roots[0])
            return self._links, self._joints
        if roots:
            self._world = self._free_link("world")
            self._links.append(Link(self._world, (), (), None, 0))
        loose = [root for root in roots if root != WORLD]
        for root in loose:
            pose = make_pose(self._pose(root))
            name = self._free_name(f"{root}::placed")
            line = self._given[root].line
            self._joints.append(Joint(name, "fixed", self._world, root, pose, None, None, None, line))
            self._links.append(self._given[root])
        for root in roots:
            self._walk(root)
        if loose:
            shown = ", ".join(map(quote_name, loose[:4])) + (" …" if len(loose) > 4 else "")
            text = f"no joint holds {shown}; shown where the file places {'them' if len(loose) > 1 else 'it'}"
            self._note("hint", "several-roots", text, self._given[loose[0]].line)
        return self._links, self._joints

    def _walk(self, root: str) -> None:
        waiting = [(root, edge) for edge in reversed(self._edges.get(root, ()))]
        while waiting:
            at, edge = waiting.pop()
            child = edge.child if at == edge.parent else edge.parent
            self._hang_link(at, child, edge)
            more = (e for e in self._edges[child] if e is not edge)
            waiting += [(child, e) for e in reversed(list(more))]

    def _pose(self, name: str) -> Matrix:
        """world_from_link."""
        if name not in self._placed:
            try:
                self._placed[name] = self._frames.find_pose(name)
            except NoSuchFrame as e:
                link = self._given[name]
                self._note("error", "frame", f"link {quote_name(name)}: {e}", link.line)
                self._placed[name] = identity()
        return self._placed[name]

    def _hang_link(self, parent: str, child: str, edge: _Edge) -> None:
        draft, forward = edge.draft, parent == edge.parent
        world_from_joint = self._frames.find_pose(draft.frame)
        parent_from_joint = multiply(invert_transform(self._pose(parent)), world_from_joint)
        joint_from_child = multiply(invert_transform(world_from_joint), self._pose(child))
        kind = KINDS.get(draft.kind, "fixed")
        moves = list(self._list_moves(draft, kind, world_from_joint))
        if not forward:
            moves = [
                (name, tuple(-v for v in axis) if axis else None, limit, mimic)
                for name, axis, limit, mimic in reversed(moves)
            ]
        direct = is_identity(joint_from_child)
        at, origin = self._world if parent == WORLD else parent, parent_from_joint
        for number, (name, axis, limit, mimic) in enumerate(moves):
            last = number == len(moves) - 1
            end = child if last and direct else self._free_link(f"{name}::joint")
            if end != child:
                self._links.append(Link(end, (), (), None, draft.line))
            turn = _open(kind, limit)
            self._joints.append(
                Joint(name, turn, at, end, make_pose(origin), axis, limit, mimic, draft.line)  # type: ignore[arg-type]
            )
            at, origin = end, identity()
        self._links.append(self._given[child])
        if not direct:
            name = self._free_name(f"{draft.name}::link")
            pose = make_pose(joint_from_child)
            self._joints.append(Joint(name, "fixed", at, child, pose, None, None, None, draft.line))

    def _list_moves(
        self, draft: JointDraft, kind: str, world_from_joint: Matrix
    ) -> Iterator[tuple[str, tuple[float, ...] | None, Limit | None, Mimic | None]]:
        """The joints of one axis that it consists of."""
        if kind in ("fixed", "floating"):
            yield draft.name, None, None, None
            return
        for number, axis in enumerate(draft.axes):
            try:
                world_from_axis = self._frames.find_pose(axis.frame)
            except NoSuchFrame as e:
                self._note("error", "frame", f"joint {quote_name(draft.name)}: its axis: {e}", draft.line)
                world_from_axis = world_from_joint
            turned = rotate_vector(
                multiply(invert_transform(world_from_joint), world_from_axis), axis.direction
            )
            name = draft.name if number == 0 else self._free_name(f"{draft.name}/axis2")
            yield name, turned, axis.limit, axis.mimic

    def _free_name(self, name: str) -> str:
        """A name that no joint has yet."""
        while name in self._joint_names:
            name += "_"
        self._joint_names.add(name)
        return name

    def _free_link(self, name: str) -> str:
        while name in self._group:
            name += "_"
        self._group[name] = name
        return name


def _open(kind: str, limit: Limit | None) -> str:
    """A joint that turns without a limit is continuous."""
    if kind != "revolute" or limit is None:
        return kind
    reach = max(abs(limit.lower or 0.0), abs(limit.upper or 0.0))
    return "continuous" if reach >= UNBOUNDED else kind
