"""`posecast run`: a robot's agent, with a relay on this machine if none is given; and `posecast demo`."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from posecast_edge.cli.settings import UsageError, add_run_flags, parse_settings
from posecast_wire.command_line.parser import WRONG_ARGUMENTS, CommandParser
from posecast_wire.command_line.terminal import print_error
from posecast_wire.keys import check_name

from posecast_command.local_relay import (
    PAGE_FOLDER,
    ROBOTS_HOST,
    STATUSES,
    PortError,
    add_place_flags,
    read_place,
    show_robot,
)

PROGRAM = "posecast"
NAMELESS = "robot"
DEMO = "demo"
# flags for a relay elsewhere: with any of them, none is started here
ELSEWHERE = ("relay", "relay_name", "proxy", "credential", "tls_cert", "tls_key", "tls_ca")


def make_run_parser(environment: Mapping[str, str]) -> CommandParser:
    """The parser of `posecast run`: the agent's flags, and where the started relay serves the page."""
    parser = CommandParser(
        prog=f"{PROGRAM} run",
        description="Read a robot from a source and show it on a page. Only --source is needed: without "
        "--relay, it starts a relay on this machine, and names the robot after its model if there is no "
        "--robot. With --relay, give --robot or a --credential that names the robot, and no --host, --port "
        "or --no-browser. Each flag can also be set by the environment variable in [].",
        statuses=STATUSES,
        allow_abbrev=False,
    )
    add_run_flags(parser, environment, required=("source",))
    add_place_flags(parser.add_argument_group("without --relay, for the relay that is started"))
    return parser


def run_robot(argv: Sequence[str], environment: Mapping[str, str]) -> int:
    """Run `posecast run` and return the exit status."""
    args = make_run_parser(environment).parse_args(argv)
    agent = _drop_own_flags(argv)
    named = [name for name in ELSEWHERE if getattr(args, name) is not None]
    if named:
        if agent != [*argv]:
            print_error(
                f"{PROGRAM} run",
                "--host, --port and --no-browser are for a relay started here, "
                f"--{named[0].replace('_', '-')} is for a relay elsewhere; give one kind",
            )
            return WRONG_ARGUMENTS
        from posecast_edge.cli.main import main as run_edge  # noqa: PLC0415 - Zenoh is not loaded before

        run_edge(["run", *argv], PROGRAM)
    robot = args.robot or name_robot(args.urdf or args.model)
    try:
        _check(agent, robot, environment)
        return show_robot(
            robot, ["edge", "run", *agent], read_place(args), environment, browser=not args.no_browser
        )
    except (UsageError, PortError) as e:
        print_error(f"{PROGRAM} run", str(e))
        return WRONG_ARGUMENTS


def make_demo_parser() -> CommandParser:
    """The parser of `posecast demo`."""
    parser = CommandParser(
        prog=f"{PROGRAM} demo",
        description="Show a demo robot. This starts a relay, which serves the page, and "
        "the robot's agent, prints the link, and opens it in your browser. Ctrl-C stops both.",
        statuses=STATUSES,
        allow_abbrev=False,
    )
    add_place_flags(parser)
    return parser


def run_demo(argv: Sequence[str], environment: Mapping[str, str]) -> int:
    """Run `posecast demo` and return the exit status."""
    args = make_demo_parser().parse_args(argv)
    agent = ["edge", "run", "--source", DEMO]
    # ignore the user's settings for their own relay and robot
    ours = {k: v for k, v in environment.items() if not k.startswith("POSECAST_") or k == PAGE_FOLDER}
    try:
        return show_robot(DEMO, agent, read_place(args), ours, browser=not args.no_browser)
    except PortError as e:
        print_error(f"{PROGRAM} demo", str(e))
        return WRONG_ARGUMENTS


def name_robot(model: Path | None) -> str:
    """The robot's name in the link when none is given: derived from the model's file name."""
    if model is None:
        return NAMELESS
    name = re.sub(r"[^a-z0-9]+", "-", model.name.partition(".")[0].lower()).strip("-")
    try:
        return check_name("robot", name)
    except ValueError:
        return NAMELESS


def _check(agent: Sequence[str], robot: str, environment: Mapping[str, str]) -> None:
    """Raise UsageError for arguments that the agent would refuse, before anything is started."""
    parse_settings(["run", *agent, "--robot", robot, "--relay", f"tcp/{ROBOTS_HOST}:1"], environment, PROGRAM)


def _drop_own_flags(argv: Sequence[str]) -> list[str]:
    """The arguments without the flags of this command."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    add_place_flags(parser)
    return parser.parse_known_args(argv)[1]
