"""The arguments of `posecast-relay robots`."""

from __future__ import annotations

import argparse
import ssl
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NoReturn

from posecast_wire import check_name
from posecast_wire.command_line.parser import CommandParser

from posecast_relay.config.settings import SettingsError
from posecast_relay.core.policy.policy import Audience

HELP = (
    "Decide who can publish and who can watch, and make share links. A running relay applies changes "
    "within a second."
)
STATUSES = {
    0: "success",
    1: "`check` found errors in the file, or it can't be written: nothing was changed",
    2: "wrong arguments, or the file is invalid: nothing was changed",
}
COMMANDS = {
    "add": "add a robot and print its credential",
    "rotate": "print a new credential for a robot; the old one stops working",
    "set": "decide who can watch a robot: --anyone view=public delay_s=10. Keeps the old version as FILE.bak",
    "link": "print a share link. It shows what [robots.ID.link] allows, until it expires",
    "unlink": "revoke all share links of a robot",
    "remove": "remove a robot; its credential stops working",
    "admin": "print a new credential for the page /admin; the old one stops working",
    "list": "list the robots, without secrets",
    "edit": "open the file in $VISUAL or $EDITOR, or read the new text from stdin: robots edit < FILE. The "
    "text is checked before it is written. Keeps the old version as FILE.bak, with the old credentials",
    "check": "list all errors in the file, with their lines; exit status 1 if it has any",
}
OF_A_FILE = ("admin", "list", "edit", "check")  # the other commands take a robot


class _Parser(CommandParser):
    def error(self, message: str) -> NoReturn:
        raise SettingsError(message)


def parse_robots_arguments(
    argv: Sequence[str], environ: Mapping[str, str], program: str = "posecast-relay"
) -> argparse.Namespace:
    """Read the arguments. Raises SettingsError, one line; SystemExit 0 on --help."""
    asked = make_robots_parser(environ, program).parse_args(argv)
    if not asked.robots:
        raise SettingsError("robots: give --robots FILE, the same file as the relay's --robots")
    if asked.do == "rotate" and asked.begin and asked.days is not None:
        raise SettingsError("robots rotate --begin: give --days with --finish, when the days start to count")
    if asked.do == "set" and asked.keep is None and not find_rules(asked):
        raise SettingsError("robots set: give a rule, such as --anyone view=public delay_s=10; see --help")
    return asked


def make_robots_parser(environ: Mapping[str, str], program: str = "posecast-relay") -> CommandParser:
    """Make the parser of the command. `program`: the program's name in messages."""
    parser = _Parser(prog=f"{program} robots", description=HELP, allow_abbrev=False, statuses=STATUSES)
    commands = parser.add_subparsers(dest="do", required=True, metavar="|".join(COMMANDS))
    for do, text in COMMANDS.items():
        command = commands.add_parser(do, help=text, description=text, allow_abbrev=False)
        command.add_argument(
            "--robots",
            metavar="FILE",
            default=environ.get("POSECAST_ROBOTS"),
            help="the robots file, the same as the relay's --robots [POSECAST_ROBOTS]",
        )
        if do not in OF_A_FILE:
            command.add_argument("robot", metavar="ID", type=_robot)
        if do == "add":
            command.add_argument(
                "--private",
                action="store_true",
                help="nobody can watch until you allow it with `robots set`; by default anyone sees the view "
                "`public`",
            )
            command.add_argument(
                "--certificate",
                action="store_true",
                help="make no credential: the robot shows a certificate whose common name is ID (see the "
                "relay's --zenoh-ca)",
            )
        if do == "admin":
            command.add_argument(
                "--networks",
                nargs="*",
                metavar="NET",
                help="networks from which /admin can be used, for example 10.0.0.0/8. With no NET, only from "
                "the relay's own machine. Without this option, the networks stay as they are",
            )
        if do == "set":
            _add_rules(command)
        if do == "edit":
            command.add_argument(
                "--yes",
                action="store_true",
                help="accept a text from stdin even if it removes, replaces or restores robots, credentials "
                "or keys of share links",
            )
        if do == "link":
            command.add_argument("--days", metavar="N", type=_days, default=7, help="days it is valid; 7")
            command.add_argument(
                "--url",
                metavar="URL",
                default="",
                help="address of the page; without it, only the end of the link is printed",
            )
        if do == "rotate":
            step = command.add_mutually_exclusive_group()
            step.add_argument(
                "--begin",
                action="store_true",
                help="print the next credential. Give it to the robot; it works after --finish",
            )
            step.add_argument(
                "--finish",
                action="store_true",
                help="the next credential starts to work, and the old one stops",
            )
        if do in ("add", "rotate"):
            command.add_argument(
                "--ca",
                metavar="FILE",
                help="the authority that signed the relay's certificate (PEM); by default a public one",
            )
            command.add_argument(
                "--days", metavar="N", type=_days, help="days until it expires; by default never"
            )
    return parser


def find_rules(asked: argparse.Namespace) -> dict[Audience, list[str]]:
    """Return the fields given to `set`, by audience."""
    given = {audience: getattr(asked, audience.value) for audience in Audience}
    return {audience: fields for audience, fields in given.items() if fields is not None}


def read_authority(file: str | None) -> str | None:
    """Return the first certificate in a file, as PEM; None without a file. Raises SettingsError."""
    if file is None:
        return None
    try:
        text = Path(file).read_text("ascii")
        end = "-----END CERTIFICATE-----"
        pem = text[text.index("-----BEGIN CERTIFICATE-----") : text.index(end) + len(end)]
        ssl.create_default_context().load_verify_locations(cadata=pem)
    except OSError as e:
        raise SettingsError(f"--ca {file}: {(e.strerror or str(e)).lower()}") from None
    except (ValueError, ssl.SSLError):
        raise SettingsError(f"--ca {file}: no certificate in PEM form") from None
    return pem


def _add_rules(command: argparse.ArgumentParser) -> None:
    for audience, who in (
        (Audience.ANYONE, "people without an account or link"),
        (Audience.SIGNED_IN, "people with an account"),
        (Audience.LINK, "people with a share link"),
    ):
        command.add_argument(
            f"--{audience.value}",
            dest=audience.value,
            nargs="+",
            metavar="FIELD=VALUE",
            help=f"what {who} see: view=public hz=10 delay_s=10 viewers=500 blackout=true past=2h "
            "frames=https://a.example,https://b.example. Other fields stay as they are; FIELD= removes one; "
            "`nothing` shows them nothing",
        )
    command.add_argument(
        "--keep",
        metavar="TIME",
        help="how long the object store keeps its past, for example 30d; 0: it is not kept there",
    )


def _robot(text: str) -> str:
    try:
        return check_name("robot", text)
    except ValueError as e:
        raise argparse.ArgumentTypeError(str(e)) from None


def _days(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 36500:
        raise argparse.ArgumentTypeError("use a number of days from 1 to 36500")
    return int(text)
