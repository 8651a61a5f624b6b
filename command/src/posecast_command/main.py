"""`posecast`: one name for the agent, the relay and what starts both."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import NoReturn

from posecast_wire.command_line.parser import CommandParser

EDGE = {
    "edge": "the agent beside a robot: run|probe|doctor|model|profile, as posecast-edge",
    "doctor": "what is wrong with a model, a profile, a source, in plain words",
    "probe": "what a source offers",
    "model": "model build: a robot's model and meshes, made small for phones",
    "profile": "profile new: a profile to start from, made of a model",
}
RELAY = {
    "relay": "the relay: run|robots|past, as posecast-relay",
    "robots": "who may publish and watch; share links",
    "past": "list, export and delete what is kept of the past",
}
SHELLS = ("bash", "zsh", "fish")
STATUSES = {0: "done, or ended by Ctrl-C", 1: "a part failed", 2: "wrong arguments, or a part can't start"}


def make_parser() -> CommandParser:
    """The commands, without their arguments."""
    parser = CommandParser(
        prog="posecast",
        description="Put a robot on a URL: reads it, never commands it.",
        statuses=STATUSES,
        version=True,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", title="commands")
    commands.add_parser("demo", help="a relay, its page and a robot of ours, in this terminal")
    commands.add_parser("run", help="put a robot on a relay: on one started here if --relay names none")
    for name, text in (EDGE | RELAY).items():
        commands.add_parser(name, help=text)
    completion = commands.add_parser("completion", help="a script by which a shell completes all of this")
    completion.add_argument("shell", choices=SHELLS)
    completion.epilog = 'eval "$(posecast completion bash)" in ~/.bashrc; likewise in ~/.zshrc. For fish: posecast completion fish | source'
    return parser


def main() -> NoReturn:
    """Entry point; ends the process."""
    status = 0
    with suppress(KeyboardInterrupt):
        status = _command(sys.argv[1:])
    with suppress(OSError, ValueError):  # the terminal may be gone
        sys.stdout.flush()
    os._exit(status)


def _command(argv: Sequence[str]) -> int:
    """Run one command; the exit status. Those of agent and relay end the process themselves."""
    first = argv[0] if argv else ""
    if first in EDGE:
        from posecast_edge.cli.main import main as run_edge  # noqa: PLC0415 - only what is asked for is loaded

        if first == "edge":
            run_edge(argv[1:], "posecast edge")
        run_edge(argv, "posecast")
    if first in RELAY:
        from posecast_relay.cli import main as run_relay  # noqa: PLC0415 - the same

        if first == "relay":
            run_relay(argv[1:], "posecast relay")
        run_relay(argv, "posecast")
    if first == "demo":
        from posecast_command.demo import run_demo  # noqa: PLC0415 - the same

        return run_demo(argv[1:], os.environ)
    if first == "run":
        from posecast_command.run import run_robot  # noqa: PLC0415 - the same

        return run_robot(argv[1:], os.environ)
    asked = make_parser().parse_args(argv)  # ends the process unless it is the last of them
    from posecast_command.completion import make_script  # noqa: PLC0415 - the same

    print(make_script(asked.shell))
    return 0
