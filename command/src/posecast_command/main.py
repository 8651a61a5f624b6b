"""`posecast`: one command for the agent, the relay, and both together."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import NoReturn

FAILED = 1


def main() -> NoReturn:
    """Entry point; ends the process."""
    status = 0
    try:
        with suppress(KeyboardInterrupt):
            status = _run(sys.argv[1:])
        sys.stdout.flush()
    except BrokenPipeError:  # the reader closed the pipe
        status = FAILED
    except OSError as e:
        from posecast_wire.command_line.terminal import print_error  # noqa: PLC0415 - see _command

        print_error("posecast", f"{e.filename or 'stdout'}: {e.strerror or e}")
        status = FAILED
    with suppress(OSError, ValueError):  # the terminal may be gone
        sys.stdout.flush()
    os._exit(status)


def _run(argv: Sequence[str]) -> int:
    try:
        return _command(argv)
    except SystemExit as end:  # argparse's, after --help and after mistakes
        return end.code if isinstance(end.code, int) else 0


def _command(argv: Sequence[str]) -> int:
    """Run one command and return the exit status. Commands of agent and relay end the process themselves.
    Imports happen here, and only the needed ones, so that Ctrl-C never prints a traceback."""
    from posecast_wire.command_line.terminal import open_closed_streams  # noqa: PLC0415

    from posecast_command.programs import COMMANDS, EDGE, RELAY, make_parser  # noqa: PLC0415

    open_closed_streams()
    first = argv[0] if argv else ""
    if first in EDGE:
        from posecast_edge.cli.main import main as run_edge  # noqa: PLC0415

        if first == "edge":
            run_edge(argv[1:], "posecast edge")
        run_edge(argv, "posecast")
    if first in RELAY:
        from posecast_relay.cli import main as run_relay  # noqa: PLC0415

        if first == "relay":
            run_relay(argv[1:], "posecast relay")
        run_relay(argv, "posecast")
    if first == "demo":
        from posecast_command.run import run_demo  # noqa: PLC0415

        return run_demo(argv[1:], os.environ)
    if first == "run":
        from posecast_command.run import run_robot  # noqa: PLC0415

        return run_robot(argv[1:], os.environ)
    parser = make_parser()
    if not argv:
        parser.error(f"give a command: {', '.join(COMMANDS)}; --help describes them")
    asked = parser.parse_args(argv)  # ends the process unless the command is `completion`
    from posecast_command.completion import make_script  # noqa: PLC0415

    print(make_script(asked.shell))
    return 0
