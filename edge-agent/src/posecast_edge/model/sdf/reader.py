"""Reads an SDF tolerantly into the types of a URDF: the robot with every joint at zero.

SDF places links in their model and joints at their child; a URDF places each link at its parent's joint. So a
joint that is not at its link's origin gets an extra link, `JOINT::joint`.
"""

from __future__ import annotations

from pathlib import Path

from posecast_edge.model.finding import ModelRefused, distrust_masses, make_printable, quote_name
from posecast_edge.model.kinematics import Matrix, identity, multiply
from posecast_edge.model.sdf.frames import (
    WORLD,
    Frame,
    FrameGraph,
    NoSuchFrame,
    Scope,
    invert_transform,
    make_pose,
)
from posecast_edge.model.sdf.includes import IncludeReader, ModelElement
from posecast_edge.model.sdf.joints import JointDraft, JointReader, hang_links
from posecast_edge.model.sdf.shapes import ShapeReader
from posecast_edge.model.sdf.values import SdfValues, get_flag
from posecast_edge.model.urdf.reader import BYTES_MAX, LINKS_MAX, NAME_MAX, show_collisions
from posecast_edge.model.urdf.resolver import Resolver, read_bounded
from posecast_edge.model.urdf.types import Link, Sensor, Urdf
from posecast_edge.model.urdf.xml_tree import Element

MODELS_MAX = 1000
MODEL = "__model__"


def load_sdf(path: Path, resolver: Resolver) -> tuple[Urdf, tuple[Path, ...]]:
    """Read a file and those that it includes, whose paths are returned, too. Raises ModelRefused when there
    is no robot in it."""
    reader = _Reader(read_bounded(path, BYTES_MAX), path, resolver)
    return reader.urdf, (path, *reader.inputs)


def read_sdf(content: bytes) -> Urdf:
    """Read one file by itself. Raises ModelRefused when there is no robot in it."""
    return _Reader(content, Path("robot.sdf"), None).urdf


class _Reader:
    """First all frames, which may be named before they are defined; then what stands in them."""

    def __init__(self, content: bytes, path: Path, resolver: Resolver | None) -> None:
        self._values = SdfValues()
        self._includes = IncludeReader(resolver, self._values)
        self._frames = FrameGraph()
        self._shapes = ShapeReader(self._values)
        self._joints = JointReader(self._values, self._frames)
        self._elements: list[tuple[str, Element, Scope, str]] = []  # of links, by their full names
        self._drafts: list[tuple[JointDraft, Element, Scope]] = []
        self._sensors: list[Sensor] = []
        self._count = 0
        models = self._choose(self._includes.read_main(content, path))
        known: set[str | None] = set()
        for number, model in enumerate(models, 1):
            self._add_model(model, None, len(models) == 1, f"_{number}" if model.name in known else "")
            known.add(model.name)
        self.inputs = self._includes.inputs
        self.urdf = self._make(models)

    def _choose(self, models: list[ModelElement]) -> list[ModelElement]:
        """Robots rather than floors and walls. Raises ModelRefused when there are none."""
        chosen = [m for m in models if not get_flag(m.element, "static")] or models
        if chosen:
            return chosen
        lost = [f for f in self._values.findings if f.code == "include"]
        if len(lost) == 1:
            raise ModelRefused(lost[0].text, lost[0].line)
        if lost:
            advice = "name the folder of its models with --package-path or GAZEBO_MODEL_PATH"
            raise ModelRefused(f"none of the {len(lost)} files that it includes was found; {advice}")
        raise ModelRefused("it has no <model>")

    def _make(self, models: list[ModelElement]) -> Urdf:
        name = (models[0].name or "") if len(models) == 1 else "world"
        urdf = Urdf(make_printable(name[:NAME_MAX]), findings=self._values.findings)
        links = [self._read_link(*one) for one in self._elements]
        for draft, element, scope in self._drafts:
            self._read_sensors(element, draft.frame, scope)
        drafts = [draft for draft, _, _ in self._drafts]
        urdf.links, urdf.joints = hang_links(links, drafts, self._frames, urdf.findings)
        urdf.sensors = self._sensors
        show_collisions(urdf, models[0].element.line)
        return urdf

    # ---- frames ----

    def _add_model(
        self, model: ModelElement, outer: Scope | None, single: bool = False, mark: str = ""
    ) -> None:
        """`mark`: what is added to its name, which another one has."""
        self._count += 1
        if self._count > MODELS_MAX:
            raise ModelRefused(f"more than {MODELS_MAX} models", model.element.line)
        name = (model.name or "")[:NAME_MAX] + mark
        what = f"model {quote_name(name)}"
        around = outer.names if outer is not None else ""
        merged = outer is not None and model.include is not None and get_merge(model.include)
        names = around if merged or single else f"{around}{name}::"
        own = f"{around}__merged__{name}{MODEL}" if merged else names + MODEL
        has_world = any(e.get("name") == "world" for e in model.element.find_all("link"))
        scope = Scope(names, own, has_world)
        base = outer.own if outer is not None else WORLD
        base = outer.find_base(model.pose, base) if outer is not None else base
        placed = self._values.read_pose(model.pose, what)
        if not self._frames.add(own, Frame(base, placed, self._find_canonical(model, scope))):
            self._values.note(
                "error", "model-doubled", f"{what} is defined twice; the first is used", model.element
            )
            return
        if outer is not None and not merged:
            self._frames.add(around + name, Frame(own, identity(), own))
        self._add_parts(model, scope)
        for nested in self._includes.list_nested(model):
            self._add_model(nested, scope)
        if model.placement:
            try:
                inside = self._frames.find_pose_inside(scope.name_frame(model.placement), own)
            except NoSuchFrame as e:
                self._values.note("error", "frame", f"{what}: placement_frame: {e}", model.element)
                return
            self._frames.replace_pose(own, multiply(placed, invert_transform(inside)))

    def _find_canonical(self, model: ModelElement, scope: Scope) -> str | None:
        """The link that a model's own frame moves with."""
        element = model.element
        named = (e.get("name") for e in element.find_all("link"))
        link = element.get("canonical_link") or next((name for name in named if name), None)
        return scope.names + link if link else None

    def _add_parts(self, model: ModelElement, scope: Scope) -> None:
        for element in model.element.children:
            if element.tag == "link":
                self._add_link(element, model, scope)
            elif element.tag == "frame":
                self._add_frame(element, scope)
            elif element.tag == "joint":
                draft = self._joints.read(element, scope, model.version)
                if draft is not None:
                    self._drafts.append((draft, element, scope))

    def _add_link(self, element: Element, model: ModelElement, scope: Scope) -> None:
        name = self._values.read_name(element, "link")
        if name is None:
            return
        if len(self._elements) >= LINKS_MAX:
            raise ModelRefused(f"more than {LINKS_MAX} links", element.line)
        full, what = scope.names + name, f"link {quote_name(scope.names + name)}"
        pose = element.find_first("pose")
        frame = Frame(scope.find_base(pose, scope.own), self._values.read_pose(pose, what), full)
        if self._frames.add(full, frame):
            self._elements.append((full, element, scope, model.base))
        else:
            self._values.note("error", "link-doubled", f"{what} is defined twice; the first is used", element)

    def _add_frame(self, element: Element, scope: Scope) -> None:
        name = self._values.read_name(element, "frame")
        if name is None:
            return
        what, pose = f"frame {quote_name(scope.names + name)}", element.find_first("pose")
        given = element.get("attached_to") or ""
        attached = scope.name_frame(given) if given else scope.own
        held = attached if attached != scope.names + name else None
        frame = Frame(scope.find_base(pose, attached), self._values.read_pose(pose, what), held)
        if not self._frames.add(scope.names + name, frame):
            text = f"{what} is defined twice; the first is used"
            self._values.note("error", "frame-doubled", text, element)

    # ---- what stands in them ----

    def _read_link(self, full: str, element: Element, scope: Scope, base: str) -> Link:
        what = f"link {quote_name(full)}"

        def find_pose(shape: Element) -> Matrix:
            return self._find_pose(shape, full, full, scope, what)

        visuals, collisions = (
            tuple(self._shapes.read(e, base, what, find_pose) for e in element.find_all(tag))
            for tag in ("visual", "collision")
        )
        self._read_sensors(element, full, scope)
        with distrust_masses(self._values.findings):
            inertial = self._shapes.read_inertial(element.find_first("inertial"), what, find_pose)
        return Link(full, visuals, collisions, inertial, element.line)

    def _read_sensors(self, element: Element, near: str, scope: Scope) -> None:
        """Of a link or a joint, whose frame is `near`."""
        for sensor in element.find_all("sensor"):
            kind = (sensor.get("type") or "sensor")[:NAME_MAX]
            name = (sensor.get("name") or kind)[:NAME_MAX]
            what = f"sensor {quote_name(name)}"
            try:
                link = self._frames.find_link(near)
            except NoSuchFrame:
                continue  # the joint says so
            pose = make_pose(self._find_pose(sensor, link, near, scope, what))
            self._sensors.append(Sensor(make_printable(name), make_printable(kind), link, pose, sensor.line))

    def _find_pose(self, element: Element, link: str, default: str, scope: Scope, what: str) -> Matrix:
        """link_from_element."""
        pose = element.find_first("pose")
        transform = self._values.read_pose(pose, what)
        base = scope.find_base(pose, default)
        if base == link:
            return transform
        try:
            world_from_base, world_from_link = self._frames.find_pose(base), self._frames.find_pose(link)
        except NoSuchFrame as e:
            self._values.note("error", "frame", f"{what}: {e}", element)
            return transform
        return multiply(multiply(invert_transform(world_from_link), world_from_base), transform)


def get_merge(include: Element) -> bool:
    """Whether the parts of an included model become parts of the one around it."""
    return include.get("merge") in ("true", "1")
