"""The commands `posecast-edge model build` and `posecast-edge doctor`: arguments, output and exit status."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import Any, NoReturn, TextIO

from posecast_wire.command_line.parser import CommandParser
from posecast_wire.command_line.progress_bar import ProgressBar, show_countdown
from posecast_wire.command_line.terminal import paint
from posecast_wire.credential import Credential

from posecast_edge.cli.doctor import examine_source
from posecast_edge.cli.flags import add_robot_flags, limit_number, list_packages
from posecast_edge.cli.settings import (
    RELAY_HELP,
    UsageError,
    add_link_flags,
    make_flag_adder,
    read_proof,
    read_route,
)
from posecast_edge.cli.source_stats import WATCH_MAX_S, observe_source
from posecast_edge.kit import many
from posecast_edge.model.builder.manifest import FINDINGS_MAX
from posecast_edge.model.doctor.meshes import find_lost_files
from posecast_edge.model.doctor.skeleton import examine_model
from posecast_edge.model.finding import (
    SEVERITIES,
    Finding,
    ModelRefused,
    advise_mesh_tools,
    explain_coarser,
    make_printable,
    quote_name,
)
from posecast_edge.model.moving_joints import list_moving_joints
from posecast_edge.model.robot_file import RobotFile, find_format, load_robot_file
from posecast_edge.model.serve.bundle_dir import MANIFEST, Cache, find_cache_folder, write_folder
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.resolver import Resolver
from posecast_edge.model.urdf.tree import build_tree
from posecast_edge.model.urdf.types import AUTO, UP_AXIS_MODES, Urdf
from posecast_edge.profile.reader import ProfileError, find_profile, load_profile
from posecast_edge.profile.types import Profile
from posecast_edge.sample import SourceError
from posecast_edge.sources.base import Discovering
from posecast_edge.sources.registry import find_defaults, open_source
from posecast_edge.uplink.route import check_endpoint

DESCRIPTION = "robot_description"
UP_AXIS_HELP = (
    "apply or ignore the up axis of meshes; auto: glTF's, and Collada's if that fits together (auto)"
)
SEVERITY_STYLES = {"error": "red", "warning": "yellow"}  # with colours on
CLEAN, PROBLEMS, UNUSABLE = 0, 1, 2
BUILD_STATUSES = {
    CLEAN: "built",
    PROBLEMS: "built, but every mesh is a placeholder",
    UNUSABLE: "wrong arguments, or a model that can't be used",
}
DOCTOR_STATUSES = {
    CLEAN: "no problems, or only hints",
    PROBLEMS: "errors or warnings",
    UNUSABLE: "wrong arguments, or a model, profile or source that can't be used",
}


class _Parser(CommandParser):
    def error(self, message: str) -> NoReturn:
        raise ModelRefused(message)


def run_command(argv: Sequence[str], environment: Mapping[str, str], program: str = "posecast-edge") -> int:
    """Run `model build …` or `doctor …` and return the exit status."""
    parser = make_parser(program, environment)
    file = None
    try:
        args = parser.parse_args(argv)
        file = args.urdf
        if args.command == "doctor" and not (args.urdf or args.profile or args.source or args.relay):
            raise ModelRefused("doctor: give --urdf, --profile, --source, --relay, or several of them")
        packages = list_packages(args.package_path, environment)
        if args.command == "doctor":
            return _doctor(args, packages, environment)
        return _build(args, packages, None if args.no_cache else find_cache_folder(environment))
    except ModelRefused as e:
        where = "" if file is None else f"{file}: " if e.line is None else f"{file}:{e.line}: "
        _print(sys.stderr, f"{program}: {where}{e.reason}")
    except ProfileError as e:
        for line in e.lines:
            _print(sys.stderr, f"{program}: {line}")
    except (SourceError, UsageError) as e:
        _print(sys.stderr, f"{program}: {e}")
    except BrokenPipeError:
        raise
    except OSError as e:
        _print(sys.stderr, f"{program}: {e.filename or file}: {e.strerror or e}")
    return UNUSABLE


def make_parser(program: str = "posecast-edge", environment: Mapping[str, str] = {}) -> CommandParser:
    """The parser of both commands. Flags of the doctor's link default to their variables in `environment`."""
    parser = _Parser(prog=program)
    parser.set_defaults(program=program)
    commands = parser.add_subparsers(dest="command", required=True, metavar="model|doctor")
    model = commands.add_parser("model").add_subparsers(dest="action", required=True, metavar="build")
    build = model.add_parser(
        "build", help="make a robot's model small enough for phones", statuses=BUILD_STATUSES
    )
    build.add_argument("urdf", type=Path, metavar="robot", help="URDF, xacro, SDF or MJCF")
    build.add_argument("-o", "--out", type=Path, required=True, help="folder to write the model bundle to")
    build.add_argument("--no-cache", action="store_true", help="build again, even if a cached result exists")
    doctor = commands.add_parser(
        "doctor",
        help="check a model, a profile, a source or the way to a relay for problems",
        statuses=DOCTOR_STATUSES,
    )
    doctor.add_argument("--urdf", type=Path, help="check this model: URDF, xacro, SDF or MJCF")
    doctor.add_argument("--profile", type=find_profile, help="check this profile, and that it fits the model")
    doctor.add_argument("--source", help="check that this source's data fits the model and the profile")
    doctor.add_argument(
        "--seconds", type=limit_number(0, WATCH_MAX_S), default=5.0, help="how long to watch the source (5)"
    )
    doctor.add_argument(
        "--hz", type=limit_number(1, 60), default=30.0, help="frames a second you want, 1 to 60 (30)"
    )
    # without its variable: `doctor --urdf` asks no relay
    doctor.add_argument("--relay", type=_endpoint, help=f"check each step of the way to {RELAY_HELP}")
    add_link_flags(make_flag_adder(doctor, environment, ()))
    for command in (build, doctor):
        add_robot_flags(command)
        command.add_argument("--up-axis", choices=UP_AXIS_MODES, default=AUTO, help=UP_AXIS_HELP)
    return parser


def _endpoint(text: str) -> str:
    try:
        return check_endpoint(text)
    except ValueError as e:
        raise argparse.ArgumentTypeError(str(e)) from None


def _explain_missing(error: ImportError) -> str:
    """Why the mesh tools can't be used: not installed, or a library they need is missing."""
    if isinstance(error, ModuleNotFoundError):
        return f"needs the mesh tools: {advise_mesh_tools()}"
    first: BaseException = error
    while (cause := first.__cause__ or first.__context__) is not None:
        first = cause
    return f"the mesh tools can't be loaded: {str(first).strip().partition(chr(10))[0]}"


def _doctor(args: argparse.Namespace, packages: Sequence[Path], environment: Mapping[str, str]) -> int:
    profile = load_profile(args.profile) if args.profile is not None else None
    robot = load_robot_file(args.urdf, packages, dict(args.xacro_arg)) if args.urdf is not None else None
    urdf = robot.urdf if robot is not None else None
    findings: list[Finding] = []
    if robot is not None:
        findings += _model(args, robot, packages, profile)
    if args.source is not None:
        findings += _source(args, profile, urdf)
    if profile is not None and urdf is None and args.source is None:
        channels = sum(len(f.labels) for f in profile.fields)
        counts = f"{many(len(profile.fields), 'field')}, {many(channels, 'channel')}"
        _print(sys.stdout, f"{args.profile}: {counts}: {_counted(findings)}")
    if args.relay is not None:
        findings += _relay(args, environment)
    return PROBLEMS if any(f.severity != "hint" for f in findings) else CLEAN


def _model(
    args: argparse.Namespace, robot: RobotFile, packages: Sequence[Path], profile: Profile | None
) -> list[Finding]:
    path, urdf, tree = args.urdf, robot.urdf, build_tree(robot.urdf)
    facts = lost = None
    try:
        from posecast_edge.model.builder.model_files import collect_facts, read_visual_files  # noqa: PLC0415 - an extra
        from posecast_edge.model.builder.up_axis import settle_up_axis  # noqa: PLC0415 - of that extra
    except ImportError as e:
        lost = find_lost_files(urdf, Resolver(path, packages), robot.meshes)
        text = f"checked only that mesh files exist, not their contents: {_explain_missing(e)}"
        _print(sys.stderr, f"{args.program}: {text}")
    else:
        with ProgressBar(sys.stderr) as bar:
            files = read_visual_files(robot, Resolver(path, packages), bar.show_progress)
        if tree.links:
            settle_up_axis(urdf, tree, files, args.up_axis)
        facts = collect_facts(files)
    findings = examine_model(urdf, tree, facts, profile.mapping if profile else None, lost)
    _list(findings, lambda _: _name_lines(path))
    counts = f"{many(len(urdf.links), 'link')}, {many(len(urdf.joints), 'joint')}"
    _print(sys.stdout, f"{path}: robot {quote_name(urdf.name)}, {counts}: {_counted(findings)}")
    return findings


def _source(args: argparse.Namespace, profile: Profile | None, urdf: Urdf | None) -> list[Finding]:
    """Findings that need the source's live data."""
    path = find_defaults(args.source).profile if profile is None else None
    profile = load_profile(path) if path else profile
    source = open_source(args.source, profile)
    described: list[str] = []
    if urdf is None and isinstance(source, Discovering):
        source.send_urdf_to(described.append)
    elif urdf is not None and isinstance(source, Discovering):
        source.take_joints(list_moving_joints(urdf))
    with show_countdown(sys.stderr, args.seconds, f"s of {args.source}"):
        seen = observe_source(source, args.seconds, profile)
    if described:
        urdf = read_urdf(BytesIO(described[-1].encode()))
    findings = examine_source(seen, urdf, args.hz, given=profile is not None)
    # a finding with a line number is about the URDF
    _list(findings, lambda finding: str(args.urdf or DESCRIPTION) if finding.line else args.source)
    rate = f"{many(seen.samples, 'sample')}, {seen.rate_hz:.1f} a second"
    _print(sys.stdout, f"{args.source}: {rate}: {_counted(findings)}")
    return findings


def _relay(args: argparse.Namespace, environment: Mapping[str, str]) -> list[Finding]:
    """Print each step of the way to the relay, up to the first that fails."""
    from posecast_edge.uplink.diagnosis import check_credential, check_steps  # noqa: PLC0415 - loads Zenoh

    proof, route = read_proof(args), read_route(args, environment)
    robot = proof.robot if isinstance(proof, Credential) else args.robot
    findings: list[Finding] = []
    for step in chain(check_steps(route, proof), (check_credential(route, proof, robot) for _ in (1,))):
        if step.failed:
            findings.append(Finding("error", f"relay-{step.name.lower()}", step.text))
            break
        _print(sys.stdout, f"  {step.name:11}{step.text}")
    _list(findings, lambda _: str(route))
    _print(sys.stdout, f"{route}: {_counted(findings)}")
    return findings


def _name_lines(path: Path) -> str:
    """The text that a finding's line number refers to: for xacro, the expanded text."""
    return f"{path} (expanded)" if find_format(path) == "xacro" else str(path)


def _list(findings: Sequence[Finding], name_file: Callable[[Finding], str]) -> None:
    """Print the worst FINDINGS_MAX findings; a hostile file can cause tens of thousands."""
    for finding in findings[:FINDINGS_MAX]:
        _print_finding(sys.stdout, finding, name_file(finding))
    if len(findings) > FINDINGS_MAX:
        _print(sys.stdout, f"and {len(findings) - FINDINGS_MAX} more")


def _counted(findings: Sequence[Finding]) -> str:
    counts = [(sum(f.severity == s for f in findings), s) for s in SEVERITIES]
    return ", ".join(many(n, s) for n, s in counts if n) or "nothing wrong"


def _build(args: argparse.Namespace, packages: Sequence[Path], cache: Path | None) -> int:
    path, out, arguments = args.urdf, args.out, dict(args.xacro_arg)
    try:
        from posecast_edge.model.builder.build import build_model  # noqa: PLC0415 - an extra
    except ImportError as e:
        raise ModelRefused(_explain_missing(e)) from None
    kept = Cache(cache, path, packages, arguments, args.up_axis) if cache is not None else None
    files = kept.get() if kept is not None else None
    if files is None:
        robot, resolver = load_robot_file(path, packages, arguments), Resolver(path, packages)
        with ProgressBar(sys.stderr) as bar:
            built = build_model(robot, resolver, bar.show_progress)
        files = {**built.files, MANIFEST: built.manifest}
        if kept is not None:
            kept.put(files, resolver, robot.inputs)
    if coarser := explain_coarser():
        _print(sys.stderr, f"{args.program}: {path}: {coarser}")
    write_folder(out, files)
    return _report(path, out, json.loads(files[MANIFEST]), args.program)


def _report(path: Path, out: Path, manifest: Mapping[str, Any], program: str) -> int:
    """Print the result. Returns the exit status: 1 when every visual is a placeholder."""
    for finding in manifest.get("findings", []):
        if finding["severity"] != "hint":
            shown = Finding(finding["severity"], finding["code"], finding["text"], finding.get("line"))
            _print_finding(sys.stderr, shown, _name_lines(path))
    stand_ins = sum("placeholder" in v for v in manifest["visuals"])
    more = f", {many(stand_ins, 'placeholder')} among them" if stand_ins else ""
    links, visuals = many(len(manifest["links"]), "link"), many(len(manifest["visuals"]), "visual")
    _print(sys.stdout, f"{out}: {links}, {visuals}{more}")
    for level in manifest["levels"]:
        size, error = f"{level['bytes'] / 1e3:,.0f} kB", f"{level['error_m'] * 1e3:.2g} mm"
        _print(
            sys.stdout, f"  {level['name']:7}{size:>10}{level['triangles']:>10,} triangles, within {error}"
        )
    if stand_ins == 0 or stand_ins < len(manifest["visuals"]):
        return CLEAN
    text = "no mesh was found, so only placeholders can be shown; give their folder with --package-path DIR"
    _print(sys.stderr, f"{program}: {path}: {text}")
    return PROBLEMS


def _print_finding(out: TextIO, finding: Finding, file: str) -> None:
    line = make_printable(finding.format_line(file))
    style = SEVERITY_STYLES.get(finding.severity)
    if style is not None:
        severity = f": {finding.severity}: "
        line = line.replace(severity, f": {paint(finding.severity, style, out)}: ", 1)
    print(line, file=out)


def _print(out: TextIO, text: str) -> None:
    print(make_printable(text), file=out)
