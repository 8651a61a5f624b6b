"""`posecast-relay robots`: decides who can publish and who can watch, and makes share links."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

from posecast_wire import Credential

from posecast_relay.config.robots_arguments import find_rules, parse_robots_arguments, read_authority
from posecast_relay.config.robots_changes import RobotsDocument, expire_in_days
from posecast_relay.config.robots_difference import list_credential_changes
from posecast_relay.config.robots_editor import edit_text, read_stdin
from posecast_relay.config.robots_file import read_robots, read_text
from posecast_relay.config.robots_reader import Robots, RobotsError, describe_rule, parse_robots
from posecast_relay.config.robots_storage import lock_folder, replace_text
from posecast_relay.config.settings import MEMORY, SettingsError
from posecast_relay.core.policy.policy import PUBLIC, Audience, Rule

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
