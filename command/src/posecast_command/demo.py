"""`posecast demo`: a relay, its page and a demo robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from posecast_wire.command_line.parser import WRONG_ARGUMENTS, CommandParser
from posecast_wire.command_line.terminal import print_error

from posecast_command.local_relay import STATUSES, add_place_flags, read_place, show_robot
from posecast_command.ports import PortError

ROBOT = "demo"
PAGE_FOLDER = "POSECAST_STATIC"  # in a checkout the page is not inside the relay


def make_demo_parser() -> CommandParser:
    """The parser of the command."""
    parser = CommandParser(
        prog="posecast demo",
        description="Show a demo robot. This starts a relay, which serves the page, and "
        "the robot's agent, prints the link, and opens it in your browser. Ctrl-C stops both.",
        statuses=STATUSES,
        allow_abbrev=False,
    )
    add_place_flags(parser)
    return parser


def run_demo(argv: Sequence[str], environment: Mapping[str, str]) -> int:
    """Run the command and return the exit status."""
    args = make_demo_parser().parse_args(argv)
    agent = ["edge", "run", "--source", "demo"]
    # ignore the user's settings for their own relay and robot
    ours = {k: v for k, v in environment.items() if not k.startswith("POSECAST_") or k == PAGE_FOLDER}
    try:
        return show_robot(ROBOT, agent, read_place(args), ours, browser=not args.no_browser)
    except PortError as e:
        print_error("posecast demo", str(e))
        return WRONG_ARGUMENTS
