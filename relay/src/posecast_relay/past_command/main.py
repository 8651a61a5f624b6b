"""`posecast-relay past`: lists, exports and deletes the kept past."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from posecast_wire.command_line.parser import CommandParser

from posecast_relay.archive.store import ArchiveError
from posecast_relay.config.settings import SettingsParser
from posecast_relay.past_command import deletion, export, listing
from posecast_relay.past_command.common import CommandFailed, RelayAway

STATUSES = {0: "success", 1: "the command failed, or you answered no", 2: "wrong arguments"}


class Subcommand(NamedTuple):
    """A subcommand: its one-line help, its arguments, and the function that runs it."""

    help: str
    add_arguments: Callable[[argparse.ArgumentParser, Mapping[str, str]], None]
    run: Callable[[argparse.Namespace], None]


COMMANDS = {
    "list": Subcommand(listing.HELP, listing.add_arguments, listing.run),
    "export": Subcommand(export.HELP, export.add_arguments, export.run),
    "delete": Subcommand(deletion.HELP, deletion.add_arguments, deletion.run),
}


def run_past(argv: Sequence[str], environ: Mapping[str, str], program: str = "posecast-relay") -> None:
    """Run one `posecast-relay past` command. `program` is its name in messages.

    Raises SettingsError with a one-line message for wrong arguments, and SystemExit 1 on failure.
    """
    asked = make_past_parser(environ, program).parse_args(argv)
    try:
        COMMANDS[asked.do].run(asked)
    except ArchiveError as e:
        print(f"{program}: the past's store: {e}", file=sys.stderr)
        raise SystemExit(1) from None
    except (RelayAway, CommandFailed) as e:
        print(f"{program}: {e}", file=sys.stderr)
        raise SystemExit(1) from None


def make_past_parser(environ: Mapping[str, str], program: str = "posecast-relay") -> CommandParser:
    """Make the command's parser. `program` is its name in messages."""
    parser = SettingsParser(
        prog=f"{program} past",
        description="List, export and delete the kept past.",
        allow_abbrev=False,
        statuses=STATUSES,
    )
    commands = parser.add_subparsers(dest="do", required=True, metavar="|".join(COMMANDS))
    for name, each in COMMANDS.items():
        command = commands.add_parser(
            name, help=each.help, description=each.help, allow_abbrev=False, statuses=STATUSES
        )
        each.add_arguments(command, environ)
        command.set_defaults(program=program)
    return parser
