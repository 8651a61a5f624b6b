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

HELP = "Who may publish, who may watch, and share links. A running relay follows within a second."
STATUSES = {
    0: "done",
    1: "`check` found the file wrong",
    2: "wrong arguments, or a file that is wrong or can't be written: nothing was changed",
}
COMMANDS = {
    "add": "let a robot publish; prints its credential",
    "rotate": "give a robot a new credential; the old one is worth nothing from then on",
    "set": "say who may watch a robot: --anyone view=public delay_s=10. The version before stays as FILE.bak",
    "link": "print a share link: whoever has it sees what [robots.ID.link] says, until it expires",
    "unlink": "no share link of this robot is worth anything from then on",
    "remove": "forget a robot; its credential is worth nothing from then on",
    "admin": "print a new credential for the page /admin; the one before is worth nothing from then on",
    "list": "the robots, without their secrets",
    "edit": "open the file in $VISUAL or $EDITOR, or take its text from stdin: robots edit < FILE. It is "
    "checked before it is written; the version before stays as FILE.bak, with the credentials of then",
    "check": "all that is wrong with the file, with lines; exit status 1 if anything is",
}
OF_A_FILE = ("admin", "list", "edit", "check")  # the others are of a robot


class _Parser(CommandParser):
    def error(self, message: str) -> NoReturn:
        raise SettingsError(message)


def parse_robots_arguments(
    argv: Sequence[str], environ: Mapping[str, str], program: str = "posecast-relay"
) -> argparse.Namespace:
    """Read the arguments. Raises SettingsError, one line; SystemExit 0 on --help."""
    asked = make_robots_parser(environ, program).parse_args(argv)
    if not asked.robots:
        raise SettingsError("robots: give --robots FILE, the file that the relay is started with")
    if asked.do == "rotate" and asked.begin and asked.days is not None:
        raise SettingsError("robots rotate --begin: say --days with --finish, when it begins to count")
    if asked.do == "set" and asked.keep is None and not find_rules(asked):
        raise SettingsError("robots set: say what, as --anyone view=public delay_s=10; see --help")
    return asked


def make_robots_parser(environ: Mapping[str, str], program: str = "posecast-relay") -> CommandParser:
    """Make the parser of the command. `program`: what it is called in messages."""
    parser = _Parser(prog=f"{program} robots", description=HELP, allow_abbrev=False, statuses=STATUSES)
    commands = parser.add_subparsers(dest="do", required=True, metavar="|".join(COMMANDS))
    for do, text in COMMANDS.items():
        command = commands.add_parser(do, help=text, description=text, allow_abbrev=False)
        command.add_argument(
            "--robots",
            metavar="FILE",
            default=environ.get("POSECAST_ROBOTS"),
            help="the relay's --robots [POSECAST_ROBOTS]",
        )
        if do not in OF_A_FILE:
            command.add_argument("robot", metavar="ID", type=_robot)
        if do == "add":
            command.add_argument(
                "--private",
                action="store_true",
                help="nobody may watch until the file says who; without: anyone sees its view `public`",
            )
            command.add_argument(
                "--certificate",
                action="store_true",
                help="no secret: it will show a certificate whose common name is ID (the relay's --zenoh-ca)",
            )
        if do == "admin":
            command.add_argument(
                "--networks",
                nargs="*",
                metavar="NET",
                help="from where it may be used, beside the relay's own machine: 10.0.0.0/8; none: nowhere",
            )
        if do == "set":
            _add_rules(command)
        if do == "edit":
            command.add_argument(
                "--yes",
                action="store_true",
                help="take a text from stdin also where it removes, replaces or brings back robots, "
                "credentials or keys of share links",
            )
        if do == "link":
            command.add_argument("--days", metavar="N", type=_days, default=7, help="good for so long; 7")
            command.add_argument(
                "--url", metavar="URL", default="", help="of the page; without: only its end"
            )
        if do == "rotate":
            step = command.add_mutually_exclusive_group()
            step.add_argument(
                "--begin",
                action="store_true",
                help="print the next credential, which is worth nothing yet: give it to the robot first",
            )
            step.add_argument(
                "--finish",
                action="store_true",
                help="the next credential is good from then on, and the one before worth nothing",
            )
        if do in ("add", "rotate"):
            command.add_argument(
                "--ca",
                metavar="FILE",
                help="what signed the relay's certificate (PEM); without: an authority of the web",
            )
            command.add_argument(
                "--days", metavar="N", type=_days, help="worth nothing after so many; without: until removed"
            )
    return parser


def find_rules(asked: argparse.Namespace) -> dict[Audience, list[str]]:
    """Return the fields that `set` was given, by audience."""
    given = {audience: getattr(asked, audience.value) for audience in Audience}
    return {audience: fields for audience, fields in given.items() if fields is not None}


def read_authority(file: str | None) -> str | None:
    """Return the first certificate of a file, as PEM; None without a file. Raises SettingsError."""
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
        (Audience.ANYONE, "whoever proves nothing"),
        (Audience.SIGNED_IN, "whoever proves an account"),
        (Audience.LINK, "whoever has a share link"),
    ):
        command.add_argument(
            f"--{audience.value}",
            dest=audience.value,
            nargs="+",
            metavar="FIELD=VALUE",
            help=f"what {who} sees: view=public hz=10 delay_s=10 viewers=500 blackout=true past=2h "
            "frames=https://a.example,https://b.example. Other fields stay; FIELD= takes one out; "
            "`nothing`: they see nothing",
        )
    command.add_argument(
        "--keep", metavar="TIME", help="its past stays so long in the store, as 30d; 0: not at all"
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
