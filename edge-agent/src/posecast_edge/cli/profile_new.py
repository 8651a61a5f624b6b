"""The command `posecast-edge profile new`: writes an initial profile for a robot's model.

Channels are named after the model's joints. If the robot reports other names, change them in [labels] and set
under [joints] which joint each moves. `posecast-edge doctor` reports what still doesn't match.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from posecast_wire.command_line.parser import CommandParser

from posecast_edge.cli.flags import add_robot_flags, list_packages
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.robot_file import load_robot_file
from posecast_edge.model.urdf.tree import build_tree
from posecast_edge.model.urdf.types import SCALAR_TYPES, Joint, Urdf
from posecast_edge.profile.defaults import SLIDING
from posecast_edge.profile.reader import ProfileError, parse_profile

FREE = ("floating", "planar")
SENSOR_KINDS = {"imu": "imu", "force_torque": "wrench"}  # of the URDF → of a profile
SENSOR_FIELDS = {
    "imu": (("quat", "wxyz"), ("gyro", "xyz"), ("acc", "xyz")),
    "wrench": (("ftf", "xyz"), ("ftm", "xyz")),
}
WIDTH = 100
DONE, REFUSED = 0, 2
STATUSES = {DONE: "written", REFUSED: "wrong arguments, or no profile can be made from the model"}


def run_profile(argv: Sequence[str], program: str = "posecast-edge") -> int:
    """Run the command with the arguments after `profile` and return the exit status."""
    args = make_parser(program).parse_args(argv)
    try:
        urdf = load_robot_file(
            args.urdf, list_packages(args.package_path, os.environ), dict(args.xacro_arg)
        ).urdf
        text = make_profile_text(urdf, args.urdf.name)
        if args.out is None:
            sys.stdout.write(text)
        else:
            _write(args.out, text)
    except ModelRefused as e:
        line = "" if e.line is None else f":{e.line}"
        print(f"{program}: {args.urdf}{line}: {e.reason}", file=sys.stderr)
        return REFUSED
    except ProfileError as e:
        print(f"{program}: {args.urdf}: can't make a profile from this model: {e}", file=sys.stderr)
        return REFUSED
    except BrokenPipeError:  # the reader closed the pipe
        raise
    except FileExistsError:
        print(f"{program}: {args.out}: the file exists already and was not changed", file=sys.stderr)
        return REFUSED
    except OSError as e:
        print(f"{program}: {e.filename or args.urdf}: {e.strerror or e}", file=sys.stderr)
        return REFUSED
    return DONE


def make_parser(program: str = "posecast-edge") -> CommandParser:
    """The parser of the command."""
    parser = CommandParser(prog=f"{program} profile")
    commands = parser.add_subparsers(dest="command", required=True, metavar="new")
    new = commands.add_parser("new", help="generate a profile from a robot's model", statuses=STATUSES)
    new.add_argument("--urdf", type=Path, required=True, help="the robot's model: URDF, xacro, SDF or MJCF")
    add_robot_flags(new)
    new.add_argument("-o", "--out", type=Path, help="the file to write; without it, print the profile")
    return parser


def _write(path: Path, text: str) -> None:
    """Write a new file; on failure leave none behind."""
    file = path.open("x", encoding="utf-8")
    try:
        with file:
            file.write(text)
    except OSError as e:
        with suppress(OSError):
            path.unlink()
        e.filename = str(path)  # the error of a full disk has no file name
        raise


def _units(joints: Iterable[str], unit: str) -> str:
    return "units = {{ {} }}".format(", ".join(f"{_key(name)} = {_text(unit)}" for name in joints))


def make_profile_text(urdf: Urdf, file: str) -> str:
    """The profile as TOML text. Raises ModelRefused when the model has no movable joint."""
    tree = build_tree(urdf)
    joints = [j for j in tree.joints if j.type in SCALAR_TYPES and j.mimic is None]
    if not joints:
        if any(j.type in FREE for j in tree.joints):
            raise ModelRefused("it has only floating and planar joints, and these have no single value")
        raise ModelRefused("it has no movable joint")
    sliding = [j.name for j in joints if j.type == "prismatic"]
    fine = f"scale = {SLIDING['pos'].scale:g} # 0.1 mm: sliding joints need it, angles get it too"
    units = [fine, _units(sliding, SLIDING["pos"].unit)] if sliding else []
    out = [
        f"# Made from {_text(file)} by `posecast-edge profile new`; the guide explains every table.",
        "",
        "[robot]",
        f"name = {_text(urdf.name or 'robot')}",
        f"root = {_text(tree.links[0].name)}",
        "",
        "# channels: the robot's own names for its readings. A channel moves the joint of the same name.",
        "[labels]",
        f"joint = [\n{_list([j.name for j in joints])}]",
        "",
        "[[fields]] # commanded joint positions; delete the fields your robot does not report",
        'name = "ref"',
        *units,
        "",
        "[[fields]] # measured joint positions",
        'name = "pos"',
        *units,
        "",
        "[[fields]]",
        'name = "vel"',
        *([_units(sliding, SLIDING["vel"].unit)] if sliding else []),
        "",
        "# more fields that the page knows:",
        *(f'# [[fields]]\n# name = "{name}" # {what}' for name, what in MORE),
        *_sensors(urdf),
        "",
        "# pos further than this from ref is marked on the page: rad, or m for a sliding joint",
        "[tolerance]",
        '"*" = 0.05',
        *(f"{_key(name)} = 0.005" for name in sliding),
        "",
        "[names]",
        *(f"{_key(j.name)} = {_text(split_name(j.name))}" for j in joints),
        *_mimics(tree.joints),
    ]
    text = "\n".join(out) + "\n"
    parse_profile(text, file)  # never write a profile that the agent would refuse
    return text


MORE = (
    ("cur", "motor currents, A"),
    ("temp", "temperatures, °C"),
    ("flags", 'with bits = ["homed", "enabled", "jam"] and a [severity.flags]'),
    ("volt", 'with labels = ["main"]'),
    ("amp", 'with labels = ["main"]'),
    ("base", 'position of the root, m, with labels = ["base.x", "base.y", "base.z"]'),
    ("baseq", 'orientation of the root, with labels = ["base.w", "base.x", "base.y", "base.z"]'),
)


def split_name(name: str) -> str:
    """Split an identifier into words: `left_hip_pitch_joint` → `left hip pitch`, `HeadYaw` → `head yaw`.
    Abbreviations stay as they are."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name)
    parts = [w for w in re.split(r"[_\-./\s]+", words) if w]
    if len(parts) > 1 and parts[-1].lower() in ("joint", "jnt", "j"):
        parts.pop()
    return " ".join(w if w.isupper() else w.lower() for w in parts) or name


def _sensors(urdf: Urdf) -> list[str]:
    known = [s for s in urdf.sensors if s.kind in SENSOR_KINDS and any(s.link == x.name for x in urdf.links)]
    if not known:
        return [
            "",
            "# a sensor: its site is the part of its labels before the dot",
            "# [sensors]",
            '# foot = { kind = "wrench", name = "right foot", link = "…", xyz = [0, 0, 0], rpy = [0, 0, 0] }',
        ]
    out: list[str] = []
    for kind in ("wrench", "imu"):
        sites = [_site(s.name) for s in known if SENSOR_KINDS[s.kind] == kind]
        for field, parts in SENSOR_FIELDS[kind] if sites else ():
            prefix = field[-1] if kind == "wrench" else ""
            labels = [f"{site}.{prefix}{c}" for site in sites for c in parts]
            out += ["", "[[fields]]", f'name = "{field}"', f"labels = [\n{_list(labels)}]"]
    out += ["", "[sensors]"]
    for s in known:
        where = f"xyz = {list(s.pose.xyz)}, rpy = {list(s.pose.rpy)}"
        kind = SENSOR_KINDS[s.kind]
        out.append(f'{_key(_site(s.name))} = {{ kind = "{kind}", link = {_text(s.link)}, {where} }}')
    return out


def _site(name: str) -> str:
    return name.replace(".", "_")


def _mimics(joints: Sequence[Joint]) -> list[str]:
    found = [j for j in joints if j.mimic is not None]
    if not found:
        return []
    return ["", f"# the model defines these as mimic joints: {', '.join(_text(j.name) for j in found)}"]


def _list(items: Sequence[str]) -> str:
    lines, line = [], " "
    for item in items:
        word = f" {_text(item)},"
        if len(line) + len(word) > WIDTH:
            lines.append(line)
            line = " "
        line += word
    return "".join(f"{x}\n" for x in [*lines, line])


def _text(value: str) -> str:
    escaped = "".join(c if c.isprintable() else "�" for c in value).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _key(value: str) -> str:
    return value if re.fullmatch(r"[A-Za-z0-9_-]+", value) else _text(value)
