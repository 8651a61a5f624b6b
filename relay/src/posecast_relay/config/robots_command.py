"""`posecast-relay robots`: decides who can publish and who can watch, and makes share links."""

from __future__ import annotations

import argparse
import contextlib
import os
import shlex
import shutil
import ssl
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

from posecast_wire import Credential, check_name
from posecast_wire.command_line.parser import CommandParser

from posecast_relay.config.robots_changes import RobotsDocument, expire_in_days
from posecast_relay.config.robots_file import BYTES_MAX, lock_folder, read_robots, read_text, replace_text
from posecast_relay.config.robots_reader import RobotEntry, Robots, RobotsError, describe_rule, parse_robots
from posecast_relay.config.settings import MEMORY, SettingsError, SettingsParser
from posecast_relay.core.policy import PUBLIC, Audience, Rule

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
    parser = SettingsParser(prog=f"{program} robots", description=HELP, allow_abbrev=False, statuses=STATUSES)
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


def list_credential_changes(before: Robots, after: Robots) -> list[str]:
    """Return a line for each robot, credential, key of share links and credential of `/admin` that the new
    version of the file removes, restores or replaces. Rules about viewers are ignored. The lines contain no
    secrets.
    """
    lines: list[str] = []
    for name in sorted(before.enrolled.keys() | after.enrolled.keys()):
        old, new = before.enrolled.get(name), after.enrolled.get(name)
        if old is None:
            lines.append(f"{name}: added, or restored after its removal: it can publish")
        elif new is None:
            lines.append(f"{name}: removed: its credential and its share links stop working")
        else:
            lines += (f"{name}: {change}" for change in _list_changes(old, new))
    admin_before, admin_after = (each.admin.secret if each.admin else None for each in (before, after))
    if admin_before != admin_after:
        lines.append(f"/admin: {_describe_change('credential', admin_before, admin_after)}")
    return lines


def _list_changes(old: RobotEntry, new: RobotEntry) -> list[str]:
    changes = [
        _describe_change(what, before, after)
        for what, before, after in (
            ("credential", old.secret, new.secret),
            ("next credential (`rotate --begin`)", old.next_secret, new.next_secret),
            ("key of its share links", old.link_key, new.link_key),
        )
        if before != after
    ]
    if new.expires_s > old.expires_s:
        changes.append("can publish for longer (`expires`)")
    return changes


def _describe_change(what: str, before: str | None, after: str | None) -> str:
    if after is None:
        return f"loses its {what}"
    if before is None:
        return f"gets a {what}, possibly an old one; it had none before"
    return f"gets a different {what}, possibly an older one; the previous one stops working"


EDITORS = ("sensible-editor", "nano", "vim", "vi")  # if neither $VISUAL nor $EDITOR is set
ASK = "Enter: edit again. q: leave the file as it is. "


def read_stdin() -> str:
    """Return the text from stdin. Raises SettingsError if it is not UTF-8 or too long."""
    raw = sys.stdin.buffer.read(BYTES_MAX + 1)
    if len(raw) > BYTES_MAX:
        raise SettingsError(f"stdin: over {BYTES_MAX} bytes")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise SettingsError("stdin: not UTF-8") from None


def edit_text(
    path: Path, before: str, environ: Mapping[str, str], check: Callable[[str], object]
) -> str | None:
    """Let the user edit a text until `check` accepts it. Return the new text; None if it is unchanged.

    `check` raises RobotsError. Raises SettingsError if there is no editor, it fails, or the user gives up.
    """
    editor = _find_editor(environ)
    with tempfile.TemporaryDirectory(prefix="posecast-") as folder:  # private: it has secrets
        copy = Path(folder) / path.name
        copy.touch(0o600)
        copy.write_text(before, "utf-8")
        while True:
            _run_editor(editor, copy)
            try:
                raw = copy.read_bytes()
                text = raw.decode("utf-8-sig")
                if text == before:
                    return None
                if len(raw) > BYTES_MAX:
                    raise RobotsError(f"over {BYTES_MAX} bytes")
                check(text)
                return text
            except UnicodeDecodeError:
                mistakes: tuple[str, ...] = ("not UTF-8",)
            except OSError as e:  # the editor left no file, or a folder
                mistakes = ((e.strerror or str(e)).lower(),)
            except RobotsError as e:
                mistakes = e.mistakes
            for mistake in mistakes:
                sys.stderr.write(f"{path.name}: {mistake}\n")
            sys.stderr.write(ASK)
            sys.stderr.flush()
            answer = sys.stdin.readline()
            if not answer or answer.strip().lower() == "q":
                raise SettingsError(f"{path}: nothing was changed")


def _find_editor(environ: Mapping[str, str]) -> list[str]:
    for variable in ("VISUAL", "EDITOR"):
        if environ.get(variable):
            try:
                return shlex.split(environ[variable])
            except ValueError:
                raise SettingsError(f"{variable} {environ[variable]!r}: a quote is not closed") from None
    for name in EDITORS:
        found = shutil.which(name)
        if found:
            return [found]
    raise SettingsError("no editor found: set $EDITOR, or use `robots set`, or `robots edit < FILE`")


def _run_editor(editor: list[str], copy: Path) -> None:
    try:
        status = subprocess.run([*editor, os.fspath(copy)], check=False).returncode
    except OSError as e:
        raise SettingsError(f"{editor[0]}: {(e.strerror or str(e)).lower()}") from None
    if status != 0:
        raise SettingsError(f"{editor[0]} exited with status {status}: nothing was changed")


Parse = Callable[[str], Robots]


def run_robots(argv: Sequence[str], environ: Mapping[str, str], program: str = "posecast-relay") -> None:
    """Run one `posecast-relay robots` command. It prints a new credential or link to stdout.

    Raises SettingsError, with one line, for wrong arguments and for a file that is invalid; SystemExit 1 if
    it can't be written, or `check` finds errors.
    """
    asked = parse_robots_arguments(argv, environ, program)
    path = Path(asked.robots)
    # in the relay's container its variables are set, so we know whether it has an object store
    parse = partial(parse_robots, has_store=environ.get("POSECAST_PAST") not in ("0", MEMORY))
    try:
        if asked.do == "list":
            _list(read_robots(path))
        elif asked.do == "check":
            parse(read_text(path))
            sys.stderr.write(f"{path}: no errors\n")
        elif asked.do == "edit":
            _edit(path, environ, parse, asked.yes)
        else:
            _change(path, asked, parse)
    except RobotsError as e:
        mistakes = [text if text.startswith(f"{path}: ") else f"{path}: {text}" for text in e.mistakes]
        if asked.do == "check":
            print(*mistakes, sep="\n", flush=True)
            raise SystemExit(1) from None
        more = "" if len(mistakes) == 1 else f"; and {len(mistakes) - 1} more: `robots check` lists all"
        raise SettingsError(mistakes[0] + more) from None
    except (FileNotFoundError, NotADirectoryError) as e:  # the path of the file is wrong
        raise SettingsError(f"{path}: {(e.strerror or str(e)).lower()}") from None
    except OSError as e:  # for example a full disk
        print(f"{program}: {path}: {e.strerror.lower() if e.strerror else e}", file=sys.stderr)
        raise SystemExit(1) from None


def _edit(path: Path, environ: Mapping[str, str], parse: Parse, may_change_credentials: bool) -> None:
    """Take the new text from an editor if stdin is a terminal, else from stdin."""
    if not sys.stdin.isatty():
        _take_stdin(path, parse, may_change_credentials)
        return
    before = read_text(path)
    changed = edit_text(path, before, environ, parse)
    if changed is None:
        sys.stderr.write(f"{path}: unchanged\n")
        return
    try:
        with lock_folder(path):
            if read_text(path) != before:
                raise SettingsError(f"{path}: another command changed it while you were editing")
            replace_text(path, changed, keep_before=True)
    except (SettingsError, RobotsError) as e:
        raise SettingsError(f"{e}; your text is saved in {_save(changed)}") from None
    except OSError as e:
        why = (e.strerror or str(e)).lower()
        raise OSError(f"{why}; your text is saved in {_save(changed)}") from None
    with contextlib.suppress(RobotsError):  # the old text was invalid; the user has seen it in the editor
        _print_lines(path, list_credential_changes(parse_robots(before), parse(changed)))


def _take_stdin(path: Path, parse: Parse, may_change_credentials: bool) -> None:
    """Write the text from stdin. It may be a copy from before the last `rotate` or `unlink`. So the command
    lists the credentials that it would change, and writes the text only if the user has agreed.
    """
    text = read_stdin()
    try:
        robots = parse(text)
    except RobotsError as e:
        _print_lines("stdin", e.mistakes)
        raise SettingsError(f"{path}: nothing was changed") from None
    with lock_folder(path):
        changes: Sequence[str] = ()
        if path.exists():
            try:
                changes = list_credential_changes(read_robots(path), robots)
            except RobotsError as e:
                changes = (f"can't compare credentials, because the present file is invalid: {e}",)
        _print_lines("stdin", changes)
        if changes and not may_change_credentials:
            raise SettingsError(
                f"{path}: nothing was changed; to write this text anyway, use `robots edit --yes`"
            )
        replace_text(path, text, keep_before=True)


def _print_lines(name: object, lines: Sequence[str]) -> None:
    sys.stderr.write("".join(f"{name}: {line}\n" for line in lines))


def _save(text: str) -> str:
    """Save a text that could not be written to the robots file, for this user only. Return its path."""
    handle, name = tempfile.mkstemp(prefix="posecast-robots-", suffix=".toml")
    with os.fdopen(handle, "w") as file:
        file.write(text)
    return name


def _change(path: Path, asked: argparse.Namespace, parse: Parse) -> None:
    """Run a command that changes the file, and print the new credential or link, if any."""
    ca = read_authority(asked.ca) if asked.do in ("add", "rotate") else None
    with lock_folder(path):
        doc = RobotsDocument(read_text(path) if path.exists() else None, str(path))
        had_begun = asked.do == "rotate" and doc.has_begun_rotation(asked.robot)
        made = _apply(doc, asked, ca)
        text = doc.make_text()
        robots = parse(text)
        replace_text(path, text, keep_before=asked.do == "set")
    if asked.do in ("add", "set"):
        seen_by = _describe_audiences(robots.enrolled[asked.robot].rules)
        hint = f". To change this, use `robots set {asked.robot}`" if asked.do == "add" else ""
        sys.stderr.write(f"Who can watch {asked.robot!r}: {seen_by}{hint}.\n")
    if asked.do == "set":
        for view in sorted({rule.view for rule in robots.enrolled[asked.robot].rules.values()} - {PUBLIC}):
            sys.stderr.write(
                f"View {view!r} shows nothing unless the robot's profile defines it; "
                "/admin lists the views that the robot sends.\n"
            )
    if asked.do == "admin":
        sys.stderr.write(
            "The next line is the credential for the page /admin, shown only once. The old one stops\n"
            "working. Enter it on that page, from this machine or from the --networks that you allowed.\n"
        )
    if isinstance(made, str):
        print(made, flush=True)
    elif isinstance(made, Credential):
        sys.stderr.write(
            f"The next line is the credential of {asked.robot!r}, shown only once. Save it in a file on the\n"
            "robot's computer, chmod 600, and start the agent with --credential FILE.\n"
        )
        if asked.do == "rotate" and asked.begin:
            sys.stderr.write(f"It does not work until you run `robots rotate {asked.robot} --finish`.\n")
            if had_begun:
                sys.stderr.write("It replaces the one from an earlier --begin.\n")
        print(made.line(), flush=True)
    elif asked.do == "add":
        sys.stderr.write(f"{asked.robot!r} can publish with a certificate that has this common name.\n")


def _apply(doc: RobotsDocument, asked: argparse.Namespace, ca: str | None) -> Credential | str | None:
    """Change the document. Return the new credential or share link, if any."""
    if asked.do == "admin":
        return doc.set_admin_secret(asked.networks)
    robot, now = asked.robot, datetime.now(UTC)
    if asked.do == "add" and asked.certificate:
        doc.add_certified_robot(robot, asked.private, expire_in_days(now, asked.days))
    elif asked.do == "add":
        return doc.add_robot(robot, asked.private, expire_in_days(now, asked.days), ca)
    elif asked.do == "rotate" and asked.begin:
        return doc.begin_rotation(robot, ca)
    elif asked.do == "rotate" and asked.finish:
        doc.finish_rotation(robot, expire_in_days(now, asked.days))
    elif asked.do == "rotate":
        return doc.rotate_secret(robot, expire_in_days(now, asked.days), ca)
    elif asked.do == "set":
        doc.set_rules(robot, asked.keep, find_rules(asked))
    elif asked.do == "link":
        token = doc.make_share_link(robot, now + timedelta(days=asked.days))
        return f"{asked.url}#/r/{robot}?t={token}"
    elif asked.do == "unlink":
        doc.revoke_share_links(robot)
    else:
        doc.remove_robot(robot)
    return None


def _list(robots: Robots) -> None:
    now_s = datetime.now(UTC).timestamp()
    for name, robot in sorted(robots.enrolled.items()):
        if robot.expires_s == float("inf"):
            state = "until removed"
        else:
            day = datetime.fromtimestamp(robot.expires_s, UTC).strftime("%Y-%m-%d %H:%M UTC")
            state = f"expired {day}" if robot.expires_s <= now_s else f"until {day}"
        if robot.secret is None:
            state = f"by certificate only, {state}"
        print(f"{name}\t{state}\t{_describe_audiences(robot.rules)}")


def _describe_audiences(rules: Mapping[Audience, Rule]) -> str:
    """Describe who sees a robot, and what, in a few words."""
    return (
        ", ".join(f"{audience.value}: {describe_rule(audience, rule)}" for audience, rule in rules.items())
        or "nobody"
    )
