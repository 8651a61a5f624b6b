"""Reads a MuJoCo model (MJCF) as a robot: bodies become links, geoms what is seen of them."""

from __future__ import annotations

import importlib.util
import json
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from posecast_wire.command_line.installation import advise_extra

from posecast_edge.model.finding import NO_BALANCE, Finding, ModelRefused, make_printable, quote_name
from posecast_edge.model.kinematics import matrix_from_quaternion
from posecast_edge.model.mjcf.child import SECONDS_MAX, run_child
from posecast_edge.model.robot_file import RobotFile
from posecast_edge.model.sdf.frames import make_pose
from posecast_edge.model.urdf.reader import LINKS_MAX, NAME_MAX
from posecast_edge.model.urdf.types import Inertial, Link, Sensor, Urdf

if TYPE_CHECKING:
    from posecast_edge.model.mjcf.compiled import CompiledModel

NEEDS_MUJOCO = "this is a MuJoCo model (MJCF), and reading it needs MuJoCo"
COMPILER = "posecast_edge.model.mjcf.compiler"
SITE = 6  # mjtObj
# mjtSensor: what a sensor on a site is called in a URDF
SENSOR_KINDS = {1: "imu", 3: "imu", 4: "force_torque", 5: "force_torque", 27: "imu"}


def load_mjcf(path: Path, packages: Sequence[Path] = ()) -> RobotFile:
    """Read a model as a robot. MuJoCo compiles it in a separate process, limited in time and memory, which
    reads only files in the model's own folders and in `packages`.

    Raises ModelRefused with one line when MuJoCo is not installed or refuses the model.
    """
    if importlib.util.find_spec("mujoco") is None:
        raise ModelRefused(f"{NEEDS_MUJOCO}: {advise_extra('posecast-edge', 'mujoco')}")
    from posecast_edge.model.mjcf.compiled import read_model  # noqa: PLC0415 - numpy, an extra

    with tempfile.TemporaryFile() as answer:
        try:
            run_child(COMPILER, [str(path), *map(str, packages)], answer, SECONDS_MAX)
        except ModelRefused as e:
            raise _read_refusal(e) from None
        answer.seek(0)
        return make_robot(read_model(answer), path)


def _read_refusal(refused: ModelRefused) -> ModelRefused:
    """The output of the compiling process, which is JSON when the process was well."""
    try:
        line, reason = json.loads(refused.reason)
        return ModelRefused(make_printable(str(reason)), None if line is None else int(line))
    except (ValueError, TypeError):
        return refused


def make_robot(model: CompiledModel, path: Path) -> RobotFile:
    """The robot of a compiled model, whose file is `path`. Raises ModelRefused when it can't be shown, and
    when the numbers do not fit together."""
    try:
        return _make_robot(model, path)
    except (ValueError, IndexError, KeyError, OverflowError, ZeroDivisionError):
        raise ModelRefused("MuJoCo's compiler gave no usable answer") from None


def _make_robot(model: CompiledModel, path: Path) -> RobotFile:
    from posecast_edge.model.mjcf.bodies import build_body_tree  # noqa: PLC0415 - numpy
    from posecast_edge.model.mjcf.shapes import GeomReader  # noqa: PLC0415

    for kind in ("body", "joint"):
        for name, line in zip(model.names[kind], model.lines[kind], strict=True):
            if len(name) > NAME_MAX or not name.isprintable():
                text = f"{kind} {quote_name(name)}: longer than {NAME_MAX} or with control characters"
                raise ModelRefused(text, line or None)
    tree = build_body_tree(model)
    if len(tree.links) + len(tree.between) > LINKS_MAX:
        raise ModelRefused(f"more than {LINKS_MAX} links")
    shapes = GeomReader(model)
    shown = shapes.make_shapes(tree.links)
    urdf = Urdf(model.name if model.name.isprintable() and model.name else path.stem)
    for body, name in tree.links.items():
        line = model.lines["body"][body]
        urdf.links.append(Link(name, tuple(shown.get(body, ())), (), _inertial(model, body, line), line))
    urdf.links += [Link(name, (), (), None, 0) for name in tree.between]
    urdf.joints += tree.joints
    urdf.sensors += _sensors(model, tree.links)
    urdf.findings += [*tree.findings, *shapes.findings]
    urdf.findings += [Finding("warning", "picture", remark) for remark in model.remarks]
    guessed = [name for body, name in tree.links.items() if model["body_mass"][body] < 0]
    if guessed:
        many = f" and {len(guessed) - 1} more" if len(guessed) > 1 else ""
        which = f"the mass of body {quote_name(guessed[0])}{many} is derived from a mesh"
        urdf.findings.append(Finding("hint", "mass-of-mesh", f"{which}; {NO_BALANCE}: give it an <inertial>"))
    for count, what in ((model.skins, "skin"), (model.flexes, "flexible part")):
        if count:
            many = f"{count} {what}s are" if count > 1 else f"a {what} is"
            urdf.findings.append(Finding("hint", "soft", f"{many} not shown: only rigid parts are"))
    return RobotFile(urdf, shapes.meshes, tuple(map(Path, model.inputs)))


def _inertial(model: CompiledModel, body: int, line: int) -> Inertial | None:
    """A body's mass; MuJoCo gives the moments about their own axes."""
    from posecast_edge.model.mjcf.bodies import normalise_quaternion  # noqa: PLC0415 - numpy

    mass = float(model["body_mass"][body])
    if mass <= 0:
        return None
    quat = normalise_quaternion(model["body_iquat"][body])
    x, y, z = model["body_inertia"][body].tolist()
    pose = make_pose(matrix_from_quaternion(model["body_ipos"][body].tolist(), quat))
    return Inertial(mass, (x, 0.0, 0.0, y, 0.0, z), line, pose)


def _sensors(model: CompiledModel, links: dict[int, str]) -> Iterator[Sensor]:
    """Those on sites, each site and kind once, by the names that the source `mujoco` gives them."""
    from posecast_edge.model.mjcf.bodies import normalise_quaternion  # noqa: PLC0415 - numpy

    known: set[tuple[int, str]] = set()
    for kind, of, site in zip(
        model["sensor_type"].tolist(),
        model["sensor_objtype"].tolist(),
        model["sensor_objid"].tolist(),
        strict=True,
    ):
        word = SENSOR_KINDS.get(kind)
        if word is None or of != SITE or (site, word) in known:
            continue
        known.add((site, word))
        link = links.get(int(model["site_bodyid"][site]))
        if link is not None:
            quat = normalise_quaternion(model["site_quat"][site])
            at = matrix_from_quaternion(model["site_pos"][site].tolist(), quat)
            name = model.names["site"][site].replace(".", "_")[:NAME_MAX]
            yield Sensor(name, word, link, make_pose(at), 0)
