"""Connects a URDF's links and joints into one tree for kinematics. Leaves out and reports parts that do not
fit."""

from __future__ import annotations

import math
from dataclasses import dataclass

from posecast_edge.model.finding import Finding, quote_name
from posecast_edge.model.urdf.types import SCALAR_TYPES, Joint, Link, Urdf


@dataclass(frozen=True)
class Follow:
    """This joint = multiplier · the joint with index `joint` + offset. Chains of mimic joints are already
    resolved."""

    joint: int
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Tree:
    """`links[0]` is the root; `links[i + 1]` is the child of `joints[i]`, whose parent comes before it.

    Without a root there are no links, and a finding says why.
    """

    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    follows: tuple[Follow | None, ...]
    index: dict[str, int]  # of links, by name
    findings: tuple[Finding, ...]


def build_tree(urdf: Urdf) -> Tree:
    """Build the tree of the root that has the most links."""
    findings: list[Finding] = []
    links = _unique_links(urdf, findings)
    below = _joints_by_parent(urdf, links, findings)
    held = {joint.child for joints in below.values() for joint in joints}
    trees = {name: _walk(name, below) for name in links if name not in held}
    order: list[Joint] = []
    if not links:
        findings.append(Finding("error", "no-links", "it has no links", None))
    elif not trees:
        line = next(iter(links.values())).line
        findings.append(Finding("error", "no-root", "there is no root link: the joints form a loop", line))
    else:
        root = max(trees, key=lambda name: len(trees[name]))
        order = trees[root]
        _name_the_rest(root, trees, links, findings)
    names = [root, *(j.child for j in order)] if trees else []
    return Tree(
        tuple(links[n] for n in names),
        tuple(order),
        _follows(urdf, order, findings),
        {name: i for i, name in enumerate(names)},
        tuple(findings),
    )


def _unique_links(urdf: Urdf, findings: list[Finding]) -> dict[str, Link]:
    links: dict[str, Link] = {}
    for link in urdf.links:
        if first := links.get(link.name):
            name = quote_name(link.name)
            text = f"link {name} is defined twice (first in line {first.line}); the first is used"
            findings.append(Finding("error", "link-doubled", text, link.line))
        else:
            links[link.name] = link
    return links


def _joints_by_parent(urdf: Urdf, links: dict[str, Link], findings: list[Finding]) -> dict[str, list[Joint]]:
    below: dict[str, list[Joint]] = {}
    names: dict[str, Joint] = {}
    held: dict[str, Joint] = {}
    for joint in urdf.joints:
        what = f"joint {quote_name(joint.name)}"
        problem = None
        if first := names.get(joint.name):
            problem = ("joint-doubled", f"{what} is defined twice (first in line {first.line})")
        elif joint.parent and joint.parent not in links:
            problem = ("joint-parent", f"{what}: its parent link {quote_name(joint.parent)} does not exist")
        elif joint.child and joint.child not in links:
            problem = ("joint-child", f"{what}: its child link {quote_name(joint.child)} does not exist")
        elif joint.parent and joint.parent == joint.child:
            problem = ("loop", f"{what} joins link {quote_name(joint.parent)} to itself")
        elif other := held.get(joint.child):
            both = f"{quote_name(other.name)} and {quote_name(joint.name)}"
            problem = ("two-parents", f"link {quote_name(joint.child)} has two parent joints, {both}")
        names.setdefault(joint.name, joint)
        if problem:
            findings.append(Finding("error", problem[0], f"{problem[1]}; this joint is left out", joint.line))
        elif joint.parent and joint.child:  # the reader has named a joint without ends
            held[joint.child] = joint
            below.setdefault(joint.parent, []).append(joint)
    return below


def _walk(root: str, below: dict[str, list[Joint]]) -> list[Joint]:
    """Depth first, in the file's order; each parent before its children."""
    order: list[Joint] = []
    waiting = [*reversed(below.get(root, []))]
    while waiting:
        joint = waiting.pop()
        order.append(joint)
        waiting += reversed(below.get(joint.child, []))
    return order


def _name_the_rest(
    root: str, trees: dict[str, list[Joint]], links: dict[str, Link], findings: list[Finding]
) -> None:
    for other, joints in trees.items():
        if other != root:
            size = f" with the {len(joints)} below it" if joints else ""
            text = (
                f"link {quote_name(other)}{size} is not connected to the root {quote_name(root)}; not shown"
            )
            findings.append(Finding("error", "several-roots", text, links[other].line))
    reached = set(trees) | {j.child for joints in trees.values() for j in joints}
    lost = [link for name, link in links.items() if name not in reached]
    if lost:
        text = f"joints form a loop: {', '.join(quote_name(x.name) for x in lost[:4])}; not shown"
        findings.append(Finding("error", "loop", text, lost[0].line))


def _follows(urdf: Urdf, order: list[Joint], findings: list[Finding]) -> tuple[Follow | None, ...]:
    leaders = _Leaders(order, {joint.name for joint in urdf.joints})
    follows: list[Follow | None] = []
    for joint in order:
        follow = None
        if joint.mimic is not None and joint.type in SCALAR_TYPES:  # the doctor names the others
            found = leaders.of(joint)
            if isinstance(found, Follow):
                follow = found
            else:
                text = f"joint {quote_name(joint.name)} {found.text}"
                findings.append(Finding("error", found.code, text, joint.mimic.line))
        follows.append(follow)
    return tuple(follows)


@dataclass(frozen=True)
class _Problem:
    """Why a joint follows none."""

    code: str
    text: str


class _Leaders:
    """The joint that each joint finally follows. A chain is followed once, for all joints on it."""

    def __init__(self, order: list[Joint], known: set[str]) -> None:
        """`known`: names of all joints, also of those that are left out."""
        self._order = order
        self._index = {joint.name: i for i, joint in enumerate(order)}
        self._known = known
        self._found: dict[str, Follow | _Problem] = {}

    def of(self, joint: Joint) -> Follow | _Problem:
        """Of a joint that mimics another."""
        chain: dict[str, Joint] = {}
        at, end = joint, self._end(joint)
        while end is None and at.name not in chain:
            chain[at.name] = at
            assert at.mimic is not None
            target = at.mimic.joint
            if target not in self._index:
                left_out = ", which is left out" if target in self._known else ", which does not exist"
                end = _Problem("mimic-unknown", f"mimics joint {quote_name(target)}{left_out}")
            else:
                at = self._order[self._index[target]]
                end = self._end(at)
        in_circle = end is None
        for one in reversed(chain.values()):
            if end is None or in_circle:
                end = _Problem("mimic-loop", f"mimics in a loop, through {quote_name(one.name)}")
                in_circle = one is not at  # it is closed there; those before lead into it
            else:
                end = _behind(one, end)
            self._found[one.name] = end
        assert end is not None
        return end

    def _end(self, at: Joint) -> Follow | _Problem | None:
        """Where a chain ends at this joint; None when it goes on."""
        if at.mimic is not None:
            return self._found.get(at.name)
        if at.type not in SCALAR_TYPES:
            lack = "no value" if at.type == "fixed" else "more than one value"
            return _Problem(
                "mimic-fixed", f"mimics the {at.type} joint {quote_name(at.name)}, which has {lack}"
            )
        return Follow(self._index[at.name], 1.0, 0.0)


def _behind(joint: Joint, leader: Follow | _Problem) -> Follow | _Problem:
    """Whom a joint follows that mimics one who follows that leader."""
    if isinstance(leader, _Problem) or joint.mimic is None:
        return leader
    multiplier = joint.mimic.multiplier * leader.multiplier
    offset = joint.mimic.multiplier * leader.offset + joint.mimic.offset
    if not math.isfinite(multiplier) or not math.isfinite(offset):
        return _Problem("mimic-endless", "mimics another with a multiplier or offset that is not finite")
    return Follow(leader.joint, multiplier, offset)
