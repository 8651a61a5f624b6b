"""Reads the text of the robots file (`--robots`) and finds all errors in it. Does no I/O.

    [robots.hubo]
    secret = "…"            # made by `posecast-relay robots add`; a robot without one uses a certificate
    keep = "30d"            # how long the store of `--past` keeps its past; by default only memory keeps it
    [robots.hubo.anyone]    # what this audience gets; the others are `signed-in` and `link`
    view = "public"
    delay_s = 10
    past = "30m"            # how far back it can look; 0: not at all
    frames = ["https://course.example"]  # only for `anyone`: sites that can embed it; by default any
    [admin]                 # enables the page /admin
    secret = "…"            # made by `posecast-relay robots admin`
    networks = ["10.0.0.0/8"]  # where it can be used, in addition to the relay's own machine

An audience without a table sees nothing.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from posecast_wire import check_name
from posecast_wire.credential import SECRET
from posecast_wire.toml_lines import find_line, index_lines

from posecast_relay.auth.addresses import ORIGIN, Network, parse_networks
from posecast_relay.core.policy import DELAY_MAX_S, FULL_HZ, PUBLIC, Audience, Policy, Rule

AUDIENCES = tuple(str(audience.value) for audience in Audience)
ROBOT_FIELDS = ("secret", "expires", "link_key", "keep", *AUDIENCES, "next_secret")
ADMIN_FIELDS = ("secret", "networks")
RULE_FIELDS = ("view", "hz", "delay_s", "viewers", "blackout", "frames", "past")
DURATION = re.compile(r"(0|[1-9][0-9]{0,5})([smhd])", re.ASCII)
DURATION_UNITS_S = {"s": 1, "m": 60, "h": 3600, "d": 86400}
DURATION_MAX_S = 3660 * 86400.0
FRAMES_MAX = 100  # origins; a response header lists them
MISTAKES_MAX = 100  # in one file; the reader stops there
# Input that Python's TOML parser reads in quadratic time: an integer's digits, the parts of a dotted key.
ENDLESS = re.compile(
    r"""[0-9][0-9_]{400}|(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){32}""", re.ASCII
)


class RobotsError(ValueError):
    """The robots file is invalid. The message is one line that names the file and the place, never a secret.

    `mistakes`: all errors, one line each; the message is the first.
    """

    def __init__(self, *mistakes: str) -> None:
        super().__init__(mistakes[0])
        self.mistakes = mistakes


@dataclass(frozen=True)
class RobotEntry:
    """A robot in the file, valid until `expires_s` (unix). Without a secret it must show a certificate."""

    secret: str | None = field(default=None, repr=False)
    expires_s: float = float("inf")
    rules: Mapping[Audience, Rule] = field(default_factory=dict)
    link_key: str | None = field(default=None, repr=False)  # signs its share links
    keep_s: float | None = None  # how long an object store keeps its past; None: it is not kept there
    # From a rotation that has begun. It does not work yet, so a change does not concern a running relay.
    next_secret: str | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True)
class AdminEntry:
    """Who can use the page `/admin`: those with `secret`, on the relay's machine or in one of `networks`."""

    secret: str = field(repr=False)
    networks: tuple[Network, ...] = ()


@dataclass(frozen=True)
class Robots:
    """The content of the file: its robots, by name. `admin`: None if nobody can use the page `/admin`."""

    enrolled: Mapping[str, RobotEntry]
    admin: AdminEntry | None = None

    def find_secrets(self, unix_s: float) -> dict[str, str]:
        """Return the passwords that are valid at this time, by robot."""
        valid = {name: self.enrolled[name].secret for name in self.list_publishers(unix_s)}
        return {name: secret for name, secret in valid.items() if secret is not None}

    def list_publishers(self, unix_s: float) -> list[str]:
        """Return the robots that can publish at this time, by password or by certificate."""
        return [name for name, robot in self.enrolled.items() if robot.expires_s > unix_s]

    def find_link_keys(self) -> dict[str, str]:
        """Return the keys that sign share links, by robot; robots without a key are left out."""
        return {name: robot.link_key for name, robot in self.enrolled.items() if robot.link_key is not None}

    def make_policy(self) -> Policy:
        """Return the policy: who can watch what."""
        rules = {name: robot.rules for name, robot in self.enrolled.items()}
        keeps = ((name, robot.keep_s) for name, robot in self.enrolled.items())
        return Policy(rules, {name: keep_s for name, keep_s in keeps if keep_s is not None})


def parse_robots(text: str, has_store: bool = True) -> Robots:
    """Read the text of the file. Raises RobotsError with all mistakes, each with its line.

    `has_store`: whether the relay has an object store for the past; without one, `keep` is an error.
    """
    if not text.strip():  # an editor has just begun to write it, or the disk is full
        raise RobotsError("is empty; if you want no robots, leave a comment in it")
    endless = ENDLESS.search(text)
    if endless is not None:
        line = text.count("\n", 0, endless.start()) + 1
        raise RobotsError(f"a number has over 400 digits, or a key has over 32 parts (at line {line})")
    try:
        doc = tomllib.loads(text)
    except RecursionError:
        raise RobotsError("nested too deeply") from None
    except ValueError as e:  # from the TOML parser: its message may quote a character, never a value
        raise RobotsError(str(e)[:120]) from None
    mistakes = _Mistakes()
    robots = _read_document(doc, mistakes, has_store)
    if mistakes.found:
        raise RobotsError(*mistakes.describe(text))
    return robots


def format_duration(seconds: float) -> str:
    """Format a duration in the largest unit that gives a whole number: 90 s, 30 min, 12 h, 3 d."""
    units = (("d", 86400), ("h", 3600), ("min", 60), ("s", 1))
    return next(
        (f"{seconds / size:g} {name}" for name, size in units if seconds % size == 0), f"{seconds:g} s"
    )


def describe_rule(audience: Audience, rule: Rule) -> str:
    """Describe in a few words what an audience sees of a robot."""
    if rule.blackout:
        return f"nothing (blackout; to end it: robots set NAME --{audience.value} blackout=)"
    limits = [f"{rule.hz:g} Hz"] if rule.hz < FULL_HZ else []
    limits += [f"{rule.delay_s:g} s late"] if rule.delay_s else []
    limits += [f"{rule.viewers} at a time"] if rule.viewers is not None else []
    past_s = rule.compute_past_s(audience)
    limits += [f"{format_duration(past_s)} back" if past_s else "no past"]
    return f"{rule.view} ({', '.join(limits)})"


class _Mistakes:
    """Errors, each with the path of its table or field."""

    def __init__(self) -> None:
        self.found: list[tuple[str, str]] = []

    @property
    def is_full(self) -> bool:
        return len(self.found) >= MISTAKES_MAX

    def add(self, path: str, text: str) -> None:
        if not self.is_full:
            self.found.append((path, text))

    def describe(self, text: str) -> list[str]:
        """Return the errors with their lines in `text`, sorted by line."""
        try:
            lines = index_lines(text)
        except RecursionError:
            lines = {}
        placed = [(find_line(lines, path), mistake) for path, mistake in self.found]
        placed.sort(key=lambda each: each[0] or 0)
        return [f"{mistake} (at line {line})" if line else mistake for line, mistake in placed]


class _Table:
    """A table of the file: reads its fields and collects their errors."""

    def __init__(self, doc: Mapping[str, Any], path: str, fields: tuple[str, ...], mistakes: _Mistakes):
        self._doc, self._path, self._mistakes = doc, path, mistakes
        for name in doc:
            if name not in fields:  # a misspelt limit must not be ignored
                shown = re.sub(r"[^\w-]", "?", name)[:60]
                self.refuse(f": unknown field {shown!r}: use {', '.join(fields)}", name)

    def refuse(self, text: str, name: str = "") -> None:
        """Add an error in a field or in the whole table. `text` follows the table's name."""
        where = f"[{self._path}]" if self._path else "the file"
        self._mistakes.add(".".join(filter(None, (self._path, name))), where + text)

    def read(self, name: str, default: Any = None) -> Any:
        """Return the value of a field, unchecked."""
        return self._doc.get(name, default)

    def read_secret(self, name: str) -> str | None:
        secret = self._doc.get(name)
        if secret is None or (isinstance(secret, str) and SECRET.fullmatch(secret)):
            return secret
        self.refuse(f" {name}: use a secret that `posecast-relay robots` made", name)
        return None

    def read_unix_s(self, name: str) -> float:
        at = self._doc.get(name)
        if at is None:
            return float("inf")
        if isinstance(at, datetime):
            return (at if at.tzinfo else at.replace(tzinfo=UTC)).timestamp()
        self.refuse(f" {name}: want a time like 2030-01-31T12:00:00Z", name)
        return 0.0

    def read_number(self, name: str, default: float, low: float, high: float) -> float:
        value = self._doc.get(name, default)
        if not isinstance(value, bool) and isinstance(value, (int, float)) and low <= value <= high:
            return float(value)
        self.refuse(f" {name}: want a number from {low:g} to {high:g}", name)
        return default

    def read_duration_s(self, name: str, may_be_zero: bool = True) -> float | None:
        value = self._doc.get(name)
        if value is None:
            return None
        found = DURATION.fullmatch(value) if isinstance(value, str) else None
        seconds = float(int(found[1]) * DURATION_UNITS_S[found[2]]) if found is not None else -1.0
        if type(value) is int and value == 0:
            seconds = 0.0
        if not 0 <= seconds <= DURATION_MAX_S:
            zero = ", or 0" if may_be_zero else ""
            self.refuse(f' {name}: want a time like "90s", "30m", "12h" or "30d"{zero}', name)
            return None
        return seconds


def _read_document(doc: Mapping[str, Any], mistakes: _Mistakes, has_store: bool) -> Robots:
    _Table(doc, "", ("robots", "admin"), mistakes)
    admin = _read_admin(doc, mistakes)
    robots = doc.get("robots", {})
    if not isinstance(robots, dict):
        mistakes.add("robots", "robots: want tables [robots.NAME]")
        return Robots({})
    enrolled: dict[str, RobotEntry] = {}
    for name, robot in robots.items():
        path = f"robots.{name}"
        try:
            check_name("robot", name)
        except ValueError as e:
            mistakes.add(path, str(e))
            continue
        if not isinstance(robot, dict):
            mistakes.add(path, f"[{path}]: want a table")
            continue
        enrolled[name] = _read_robot(robot, path, mistakes, has_store)
        if mistakes.is_full:
            break
    return Robots(enrolled, admin)


def _read_admin(doc: Mapping[str, Any], mistakes: _Mistakes) -> AdminEntry | None:
    admin = doc.get("admin")
    if admin is None:
        return None
    if not isinstance(admin, dict):
        mistakes.add("admin", "[admin]: want a table")
        return None
    table = _Table(admin, "admin", ADMIN_FIELDS, mistakes)
    secret, given = table.read_secret("secret"), table.read("networks", [])
    networks: tuple[Network, ...] = ()
    try:
        if not isinstance(given, list) or not all(isinstance(each, str) for each in given):
            raise ValueError
        networks = parse_networks(",".join(given))
    except ValueError:
        table.refuse(' networks: want a list of networks like "10.0.0.0/8"', "networks")
    if "secret" not in admin:
        table.refuse(" secret: make one with `posecast-relay robots admin`")
    return None if secret is None else AdminEntry(secret, networks)


def _read_robot(doc: Mapping[str, Any], path: str, mistakes: _Mistakes, has_store: bool) -> RobotEntry:
    table = _Table(doc, path, ROBOT_FIELDS, mistakes)
    rules: dict[Audience, Rule] = {}
    for audience in Audience:
        rule, at = doc.get(audience.value), f"{path}.{audience.value}"
        if isinstance(rule, dict):
            rules[audience] = _read_rule(_Table(rule, at, RULE_FIELDS, mistakes), audience)
        elif audience.value in doc:
            mistakes.add(at, f"[{at}]: want a table")
    delays_s: dict[str, float] = {}
    for rule in rules.values():
        if rule.delay_s > 0 and delays_s.setdefault(rule.view, rule.delay_s) != rule.delay_s:
            table.refuse(f": two delays for view {rule.view!r}: use the same `delay_s` in all tables")
    return RobotEntry(
        table.read_secret("secret"),
        table.read_unix_s("expires"),
        rules,
        table.read_secret("link_key"),
        _read_keep_s(table, rules, path, mistakes, has_store),
        table.read_secret("next_secret"),
    )


def _read_keep_s(
    table: _Table, rules: Mapping[Audience, Rule], path: str, mistakes: _Mistakes, has_store: bool
) -> float | None:
    """Read `keep`, and check that no `past` is longer."""
    keep_s = table.read_duration_s("keep", may_be_zero=False)
    if keep_s is None:
        return None
    if keep_s <= 0:
        table.refuse(" keep: to keep nothing, leave it out", "keep")
    elif not has_store:
        table.refuse(
            " keep: needs an object store: give the relay --past file:///FOLDER or s3://BUCKET, or leave "
            "`keep` out",
            "keep",
        )
    for audience, rule in rules.items():
        if keep_s > 0 and rule.past_s is not None and rule.past_s > keep_s:
            at = f"{path}.{audience.value}"
            mistakes.add(f"{at}.past", f"[{at}] past: longer than `keep`, {table.read('keep')!r}")
    return keep_s


def _read_rule(table: _Table, audience: Audience) -> Rule:
    view, blackout, viewers = table.read("view", PUBLIC), table.read("blackout", False), table.read("viewers")
    try:
        check_name("view", view if isinstance(view, str) else "")
    except ValueError as e:
        table.refuse(f" {e}", "view")
        view = PUBLIC
    if not isinstance(blackout, bool):
        table.refuse(" blackout: want true or false", "blackout")
    if viewers is not None and (type(viewers) is not int or not 0 <= viewers <= 1_000_000):
        table.refuse(" viewers: want a whole number from 0 to 1000000", "viewers")
    hz = table.read_number("hz", FULL_HZ, 0.1, FULL_HZ)
    delay_s = table.read_number("delay_s", 0.0, 0.0, DELAY_MAX_S)
    past_s = table.read_duration_s("past")
    if past_s and hz < FULL_HZ:
        table.refuse(
            " past: not together with `hz`, because the past has every frame: show a slower view instead",
            "past",
        )
    return Rule(view, hz, delay_s, viewers, blackout, _read_frames(table, audience), past_s)


def _read_frames(table: _Table, audience: Audience) -> tuple[str, ...] | None:
    frames = table.read("frames")
    if frames is None:
        return None
    if audience is not Audience.ANYONE:
        table.refuse(" frames: only in `anyone`, because a request for a frame has no login yet", "frames")
    elif not isinstance(frames, list) or len(frames) > FRAMES_MAX:
        table.refuse(f" frames: want a list of at most {FRAMES_MAX} origins", "frames")
    else:
        for n, origin in enumerate(frames, 1):
            if not isinstance(origin, str) or not ORIGIN.fullmatch(origin):
                table.refuse(
                    f" frames: number {n} is not an origin like https://course.example", f"frames[{n - 1}]"
                )
        return tuple(frames)
    return None
