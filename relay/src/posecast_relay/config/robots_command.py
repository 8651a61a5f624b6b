"""`posecast-relay robots`: who may publish, and share links. A running relay follows within a second."""

from __future__ import annotations

import argparse
import contextlib
import fcntl
import os
import secrets
import ssl
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, NoReturn

import tomlkit
from posecast_wire import Credential, check_name

from posecast_relay.config.robots_file import Robots, RobotsError, format_duration, read_robots
from posecast_relay.config.settings import SettingsError
from posecast_relay.core.policy.policy import PUBLIC, Audience, Rule
from posecast_relay.core.policy.share_link import make_link

HEAD = "Who may publish and who may watch. A running relay follows within a second. See docs/SECURITY.md."


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise SettingsError(message)


def run_robots(argv: Sequence[str], environ: Mapping[str, str]) -> None:
    """Carry out one `posecast-relay robots` command; a new credential or link goes to stdout.

    Raises SettingsError, with one line, for wrong arguments and for a file that is wrong or can't be written.
    """
    asked = _parse(argv, environ)
    path = Path(asked.robots)
    try:
        if asked.do == "list":
            _list(read_robots(path))
            return
        ca = _authority(asked.ca) if asked.do in ("add", "rotate") else None
        with _locked(path):
            doc = _document(path)
            line = _changed(doc, asked, ca)
            text = tomlkit.dumps(doc)
            _write(path, text if text.strip() else f"# {HEAD}\n")  # a relay takes no empty file for an order
    except RobotsError as e:
        raise SettingsError(str(e)) from None
    except OSError as e:
        raise SettingsError(f"{path}: {(e.strerror or str(e)).lower()}") from None
    if asked.do == "add":
        rules = read_robots(path).enrolled[asked.robot].rules
        seen_by = ", ".join(f"{a.value}: {_shown(a, rule)}" for a, rule in rules.items()) or "nobody"
        sys.stderr.write(
            f"Who may watch {asked.robot!r}: {seen_by}. [robots.{asked.robot}.…] says otherwise.\n"
        )
    if asked.do == "link":
        print(line, flush=True)
    elif asked.do == "add" and line is None:
        sys.stderr.write(f"{asked.robot!r} may publish with a certificate whose common name is that.\n")
    elif line is not None:
        sys.stderr.write(
            f"The next line is the credential of {asked.robot!r}, shown this once: put it into a file of\n"
            "its own beside the robot, chmod 600, and give the agent --credential FILE.\n"
        )
        print(line, flush=True)


def _parse(argv: Sequence[str], environ: Mapping[str, str]) -> argparse.Namespace:
    parser = _Parser(prog="posecast-relay robots", description=__doc__, allow_abbrev=False)
    commands = parser.add_subparsers(dest="do", required=True, metavar="add|list|remove|rotate|link|unlink")
    for do, text in (
        ("add", "let a robot publish; prints its credential"),
        ("rotate", "give a robot a new credential; the old one is worth nothing from then on"),
        ("link", "print a share link: whoever has it sees what [robots.ID.link] says, until it expires"),
        ("unlink", "no share link of this robot is worth anything from then on"),
        ("remove", "forget a robot; its credential is worth nothing from then on"),
        ("list", "the robots, without their secrets"),
    ):
        command = commands.add_parser(do, help=text, description=text, allow_abbrev=False)
        command.add_argument(
            "--robots",
            metavar="FILE",
            default=environ.get("POSECAST_ROBOTS"),
            help="the relay's --robots [POSECAST_ROBOTS]",
        )
        if do != "list":
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
        if do == "link":
            command.add_argument("--days", metavar="N", type=_days, default=7, help="good for so long; 7")
            command.add_argument(
                "--url", metavar="URL", default="", help="of the page; without: only its end"
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
    asked = parser.parse_args(argv)
    if not asked.robots:
        raise SettingsError("robots: give --robots FILE, the file that the relay is started with")
    return asked


def _robot(text: str) -> str:
    try:
        return check_name("robot", text)
    except ValueError as e:
        raise argparse.ArgumentTypeError(str(e)) from None


def _days(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 36500:
        raise argparse.ArgumentTypeError("use a number of days from 1 to 36500")
    return int(text)


def _authority(file: str | None) -> str | None:
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


def _document(path: Path) -> tomlkit.TOMLDocument:
    """Parse the file, comments included; begin a new one when there is none."""
    if not path.exists():
        doc = tomlkit.document()
        doc.add(tomlkit.comment(HEAD))
        return doc
    read_robots(path)  # what the relay would refuse is not to be built upon
    return tomlkit.parse(path.read_text("utf-8-sig"))


def _changed(doc: tomlkit.TOMLDocument, asked: argparse.Namespace, ca: str | None) -> str | None:
    """Change `doc` as it was asked for, and return the new credential's line or the share link, if any."""
    if "robots" not in doc:
        doc["robots"] = tomlkit.table(is_super_table=True)
    robots: Any = doc["robots"]
    known = asked.robot in robots
    if asked.do == "add" and known and "secret" in robots[asked.robot]:
        raise SettingsError(f"robot {asked.robot!r} has a credential already: `rotate` makes a new one")
    if asked.do != "add" and not known:
        raise SettingsError(f"no robot {asked.robot!r} in {asked.robots}")
    if asked.do == "remove":
        del robots[asked.robot]
        return None
    if asked.do in ("link", "unlink"):
        return _link(robots[asked.robot], asked)
    if not known:
        robots[asked.robot] = tomlkit.table()
    robot = robots[asked.robot]
    if not known and not asked.private:
        robot[Audience.ANYONE.value] = {"view": PUBLIC}
    robot.pop("expires", None)
    if asked.days is not None:
        robot["expires"] = (datetime.now(UTC) + timedelta(days=asked.days)).replace(microsecond=0)
    if asked.do == "add" and asked.certificate:
        return None
    credential = Credential(asked.robot, secrets.token_urlsafe(32), ca)
    robot["secret"] = credential.secret
    return credential.line()


def _link(robot: Any, asked: argparse.Namespace) -> str | None:
    """Make a share link and, if there is none, the key that signs it; for `unlink` replace the key only."""
    if asked.do == "unlink" or "link_key" not in robot:
        robot["link_key"] = secrets.token_urlsafe(32)
    if asked.do == "unlink":
        return None
    if Audience.LINK.value not in robot:
        raise SettingsError(
            f"no [robots.{asked.robot}.link] in {asked.robots}: say there what its links show"
        )
    until_s = int(datetime.now(UTC).timestamp()) + asked.days * 86400
    token = make_link(str(robot["link_key"]), asked.robot, until_s, secrets.token_urlsafe(6))
    return f"{asked.url}#/r/{asked.robot}?t={token}"


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
        seen_by = ", ".join(f"{a.value}: {_shown(a, rule)}" for a, rule in robot.rules.items()) or "nobody"
        print(f"{name}\t{state}\t{seen_by}")


def _shown(audience: Audience, rule: Rule) -> str:
    """Describe what an audience gets, in a few words."""
    if rule.blackout:
        return "nothing for now"
    limits = [f"{rule.hz:g} Hz"] if rule.hz < 60 else []
    limits += [f"{rule.delay_s:g} s late"] if rule.delay_s else []
    limits += [f"{rule.viewers} at a time"] if rule.viewers is not None else []
    past_s = rule.compute_past_s(audience)
    limits += [f"{format_duration(past_s)} back" if past_s else "no past"]
    return f"{rule.view} ({', '.join(limits)})"


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold a lock on the file's folder, so that no two commands change the file at once."""
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


def _write(path: Path, text: str) -> None:
    """Replace the file in one step; only its owner may read it, and its group if it could before."""
    mode = path.stat().st_mode & 0o770 if path.exists() else 0o600
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).chmod(mode)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
