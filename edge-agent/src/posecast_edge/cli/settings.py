"""Parses flags and POSECAST_* variables into one immutable value. An error is one line and exit status 2."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn, TypeVar

from posecast_wire.command_line.parser import CommandParser
from posecast_wire.credential import Credential
from posecast_wire.keys import check_name

from posecast_edge.cli.flags import add_robot_flags, limit_number, parse_folders, parse_xacro_argument
from posecast_edge.kit import quote
from posecast_edge.model.urdf.types import AUTO, UP_AXIS_MODES
from posecast_edge.profile.reader import find_profile
from posecast_edge.sample import SourceError
from posecast_edge.sources.registry import KINDS, split_spec
from posecast_edge.uplink.credentials import Certificate, read_credential
from posecast_edge.uplink.route import RelayRoute, check_endpoint, check_server_name, make_route, parse_proxy

T = TypeVar("T")

STATUSES = {
    0: "the source ended, or the agent was stopped",
    1: "the source or the agent failed, or output could not be written",
    2: "wrong arguments, profile or model",
    130: "stopped by Ctrl-C before it ran",
}
RELAY_HELP = "the relay: tls/HOST:PORT, or tcp/127.0.0.1:PORT on this machine"
SUCH = "KIND[:ADDRESS], such as demo, csv:log.csv or mujoco:arm.xml"


class UsageError(Exception):
    """A wrong flag or variable, in one line."""


@dataclass(frozen=True)
class Settings:
    """The settings of `posecast-edge run`."""

    robot: str
    source: str
    relay: RelayRoute
    hz: float
    key_interval_s: float
    profile: Path | None
    urdf: Path | None
    model: Path | None
    credential: Credential | Certificate | None = None
    packages: tuple[Path, ...] = ()
    xacro_arguments: tuple[tuple[str, str], ...] = ()
    up_axis: str = AUTO

    def list_model_options(self) -> list[str]:
        """The options to pass on to `model build`."""
        folders = [f"--package-path={folder}" for folder in self.packages]
        arguments = [f"--xacro-arg={name}:={value}" for name, value in self.xacro_arguments]
        return [*folders, *arguments, f"--up-axis={self.up_axis}"]


class _Parser(CommandParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(message)


def _robot(text: str) -> str:
    return check_name("robot", text)


def _source(text: str) -> str:
    split_spec(text)
    return text


def read_proof(args: argparse.Namespace) -> Credential | Certificate | None:
    """How the robot proves its identity; None when it needs no proof, on the relay's own machine."""
    given: Credential | None = args.credential
    if args.tls_cert is None and args.tls_key is None and args.tls_ca is None:
        return given
    if args.tls_cert is None or args.tls_key is None:
        raise UsageError("give --tls-cert and --tls-key together; --tls-ca needs both")
    if given is not None:
        raise UsageError("give --credential or --tls-cert, not both")
    if args.relay.startswith("tcp/"):
        raise UsageError(f"--relay {args.relay}: with a certificate use tls/… or quic/…")
    certificate = Certificate(args.tls_cert, args.tls_key, args.tls_ca)
    try:
        certificate.check()
    except ValueError as e:
        raise UsageError(f"--tls-cert, --tls-key, --tls-ca: {e}") from None
    return certificate


def read_route(args: argparse.Namespace, environment: Mapping[str, str]) -> RelayRoute:
    """How to reach the relay. Raises UsageError when flags don't fit together."""
    try:
        return make_route(args.relay, args.relay_name, args.proxy, environment)
    except ValueError as e:
        raise UsageError(str(e)) from None


def _named(robot: str | None, credential: Credential | Certificate | None) -> str:
    if not isinstance(credential, Credential):
        if robot is None:
            raise UsageError("the following arguments are required: --robot, or a --credential that names it")
        return robot
    if robot not in (None, credential.robot):
        raise UsageError(f"--credential is for robot {credential.robot!r}, but --robot is {robot!r}")
    return credential.robot


def _up_axis(text: str) -> str:
    if text not in UP_AXIS_MODES:
        raise argparse.ArgumentTypeError(f"{quote(text)} is not one of {', '.join(UP_AXIS_MODES)}")
    return text


def _explaining(parse: Callable[[str], object], variable: str, given: str | None) -> Callable[[str], object]:
    """Wrap `parse` so that its errors are argparse's, and name the environment variable if the value was
    `given` there."""

    def parsed(text: str) -> object:
        try:
            return parse(text)
        except (argparse.ArgumentTypeError, ValueError, SourceError) as e:
            raise argparse.ArgumentTypeError(f"{e} [{variable}]" if text is given else str(e)) from None

    return parsed


def _list_from(environment: Mapping[str, str], variable: str, parse: Callable[[str], list[T]]) -> list[T]:
    """A variable's value. Raises UsageError, which names the variable."""
    try:
        return parse(environment.get(variable, ""))
    except argparse.ArgumentTypeError as e:
        raise UsageError(f"{e} [{variable}]") from None


def _xacro_arguments(text: str) -> list[tuple[str, str]]:
    """Split at spaces."""
    return [parse_xacro_argument(word) for word in text.split()]


def make_flag_adder(
    parser: argparse.ArgumentParser, environment: Mapping[str, str], required: Sequence[str]
) -> Callable[..., None]:
    """A function that adds a flag, which defaults to its variable in `environment`."""

    def flag(name: str, parse: Callable[[str], object], text: str, default: object = None) -> None:
        variable = "POSECAST_" + name.upper().replace("-", "_")
        given = environment.get(variable)
        parser.add_argument(
            f"--{name}",
            type=_explaining(parse, variable, given),
            default=given if given else default,
            required=not given and name in required,
            metavar=name.upper().replace("-", "_"),
            help=f"{text} [{variable}]",
        )

    return flag


def add_link_flags(flag: Callable[..., None]) -> None:
    """Add the flags of the link to a relay with a function of `make_flag_adder`."""
    flag("robot", _robot, "the robot's name in the link: a-z, 0-9 and -; default: the credential's")
    flag(
        "relay-name",
        check_server_name,
        "the name in the relay's certificate if --relay has another, such as that of a tunnel",
    )
    flag(
        "proxy",
        parse_proxy,
        "connect through this HTTP proxy: http://[USER:PASSWORD@]HOST:PORT; default: HTTPS_PROXY, unless "
        "NO_PROXY names the relay",
    )
    # a file: everybody on the machine can read a secret on a command line
    flag("credential", read_credential, "file with the line that `posecast-relay robots add` printed")
    flag(
        "tls-cert",
        Path,
        "instead of --credential, for a relay with --zenoh-ca: the robot's certificate (PEM)",
    )
    flag("tls-key", Path, "the private key of --tls-cert (PEM)")
    flag("tls-ca", Path, "CA certificate (PEM) that signed the relay's; without it, the public CAs")


def add_run_flags(
    parser: argparse.ArgumentParser,
    environment: Mapping[str, str],
    required: Sequence[str] = ("source", "relay"),
) -> None:
    """Add the flags of `run`; a flag that is not given defaults to its variable in `environment`."""
    flag = make_flag_adder(parser, environment, required)
    flag("source", _source, f"{SUCH}; kinds: {', '.join(KINDS)}")
    flag("relay", check_endpoint, RELAY_HELP)
    add_link_flags(flag)
    flag("hz", limit_number(1, 60), "frames a second, 1 to 60 (30)", 30.0)
    flag(
        "key-interval",
        limit_number(0.2, 600),
        "seconds between KEY frames, from which viewers start (4)",
        4.0,
    )
    flag(
        "profile",
        find_profile,
        "TOML file that describes the robot's channels, or the name of a built-in profile",
    )
    flag(
        "urdf",
        Path,
        "the robot's model: URDF, xacro, SDF or MJCF; its meshes are made small enough for phones",
    )
    flag("model", Path, "instead of --urdf: the folder that `model build` wrote")
    add_robot_flags(parser)
    flag(
        "up-axis",
        _up_axis,
        "the up axis of meshes: auto (glTF's, and Collada's if that fits), ignore or apply (auto)",
        AUTO,
    )


def parse_settings(
    argv: Sequence[str], environment: Mapping[str, str], program: str = "posecast-edge"
) -> Settings:
    """Parse the arguments of `run`. Raises UsageError (one line) for a wrong one, SystemExit(0) after
    --help."""
    args = make_parser(environment, program).parse_args(argv)
    if args.command is None:
        raise UsageError(f"give a command: `{program} run …`, or --help")
    if args.urdf and args.model:
        raise UsageError("give --urdf or --model, not both")
    proof = read_proof(args)
    return Settings(
        _named(args.robot, proof),
        args.source,
        read_route(args, environment),
        args.hz,
        args.key_interval,
        args.profile,
        args.urdf,
        args.model,
        proof,
        tuple(args.package_path or _list_from(environment, "POSECAST_PACKAGE_PATH", parse_folders)),
        tuple(args.xacro_arg or _list_from(environment, "POSECAST_XACRO_ARG", _xacro_arguments)),
        args.up_axis,
    )


def make_parser(environment: Mapping[str, str], program: str = "posecast-edge") -> CommandParser:
    """The parser of the program; commands other than `run` have their own parsers."""
    parser = _Parser(
        prog=program,
        description="Put a robot on a URL. Reads the robot, never commands it.",
        version=True,
        statuses=STATUSES,
    )
    commands = parser.add_subparsers(dest="command", metavar="run|probe|doctor|model|profile")
    commands.add_parser("model", help="model build: make a robot's model small enough for phones")
    commands.add_parser("probe", help="list what a source delivers; needs no profile")
    commands.add_parser("doctor", help="check a model, a profile or a source for problems")
    commands.add_parser("profile", help="profile new: generate a profile from a robot's model")
    run = commands.add_parser(
        "run",
        help="read a source and send it to a relay",
        description="Read a source and send it to a relay. Each flag can also be set by the environment "
        "variable in [].",
        statuses=STATUSES,
    )

    add_run_flags(run, environment)
    return parser
