"""Reads the file of `--robots`, which says who may publish and who may watch what.

    [robots.hubo]
    secret = "…"            # by `posecast-relay robots add`; without one it may show a certificate
    keep = "30d"            # its past stays that long in the store of `--past`; without: in memory only
    [robots.hubo.anyone]    # an audience, and what it gets; also `signed-in` and `link`
    view = "public"
    delay_s = 10
    past = "30m"            # how far back it may look; 0: not at all
    frames = ["https://course.example"]  # `anyone` only: pages that may frame it; without: any

An audience without a table sees nothing.
"""

from __future__ import annotations

import re
import stat
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from posecast_wire import check_name
from posecast_wire.credential import SECRET

from posecast_relay.auth.origins import ORIGIN
from posecast_relay.core.policy.policy import DELAY_MAX_S, FULL_HZ, PUBLIC, Audience, Policy, Rule

BYTES_MAX = 4_000_000
ROBOT_FIELDS = ("secret", "expires", "link_key", "keep", *(str(audience.value) for audience in Audience))
RULE_FIELDS = ("view", "hz", "delay_s", "viewers", "blackout", "frames", "past")
DURATION = re.compile(r"(0|[1-9][0-9]{0,5})([smhd])", re.ASCII)
DURATION_UNITS_S = {"s": 1, "m": 60, "h": 3600, "d": 86400}
DURATION_MAX_S = 3660 * 86400.0
FRAMES_MAX = 100  # origins; they stand in a header
# What TOML's reader takes the square of to read: an integer's digits, the parts of a dotted key.
ENDLESS = re.compile(
    r"""[0-9][0-9_]{400}|(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){32}""", re.ASCII
)


class RobotsError(ValueError):
    """The file of robots is wrong. The message is one line that names the file and the place, not secrets."""


@dataclass(frozen=True)
class RobotEntry:
    """A robot of the file, valid until `expires_s` (unix). Without a secret it has to show a certificate."""

    secret: str | None = field(default=None, repr=False)
    expires_s: float = float("inf")
    rules: Mapping[Audience, Rule] = field(default_factory=dict)
    link_key: str | None = field(default=None, repr=False)  # signs its share links
    keep_s: float | None = None  # for how long its past is kept in an object store; None: not at all


@dataclass(frozen=True)
class Robots:
    """The content of the file: its robots, by name."""

    enrolled: Mapping[str, RobotEntry]

    def find_secrets(self, unix_s: float) -> dict[str, str]:
        """Return the passwords of the robots that may publish by password at this time, by robot."""
        valid = {name: self.enrolled[name].secret for name in self.list_publishers(unix_s)}
        return {name: secret for name, secret in valid.items() if secret is not None}

    def list_publishers(self, unix_s: float) -> list[str]:
        """Return the robots that may publish at this time, by password or by certificate."""
        return [name for name, robot in self.enrolled.items() if robot.expires_s > unix_s]

    def find_link_keys(self) -> dict[str, str]:
        """Return the keys that sign share links, by robot; robots without a key are left out."""
        return {name: robot.link_key for name, robot in self.enrolled.items() if robot.link_key is not None}

    def make_policy(self) -> Policy:
        """Return the policy that says who may watch what."""
        rules = {name: robot.rules for name, robot in self.enrolled.items()}
        keeps = ((name, robot.keep_s) for name, robot in self.enrolled.items())
        return Policy(rules, {name: keep_s for name, keep_s in keeps if keep_s is not None})


def read_robots(path: Path) -> Robots:
    """Read and check the file. Raises RobotsError if it can't be read, is wrong, or is open to everybody."""
    try:
        with path.open("rb") as file:
            mode = stat.S_IMODE(path.stat().st_mode)
            raw = file.read(BYTES_MAX + 1)
    except OSError as e:
        raise RobotsError(f"{path}: {(e.strerror or str(e)).lower()}") from None
    if mode & 0o007:
        raise RobotsError(f"{path}: holds secrets, and everybody on this machine may read it: chmod 600")
    if len(raw) > BYTES_MAX:
        raise RobotsError(f"{path}: over {BYTES_MAX} bytes")
    try:
        text = raw.decode("utf-8-sig")
        endless = ENDLESS.search(text)
        if endless is not None:
            line = text.count("\n", 0, endless.start()) + 1
            raise RobotsError(f"a number of over 400 digits, or a key of over 32 parts (at line {line})")
        return _robots(tomllib.loads(text))
    except UnicodeDecodeError:
        raise RobotsError(f"{path}: not UTF-8") from None
    except RobotsError as e:
        raise RobotsError(f"{path}: {e}") from None
    except RecursionError:
        raise RobotsError(f"{path}: nested too deeply") from None
    except ValueError as e:
        # TOML's own: its message may quote a letter, never a value
        raise RobotsError(f"{path}: {str(e)[:120]}") from None


def refuse_keep(robots: Robots, path: Path) -> None:
    """Refuse a file in which a robot has `keep`, for a relay that has no store. Raises RobotsError."""
    for name, robot in robots.enrolled.items():
        if robot.keep_s is not None:
            raise RobotsError(
                f"{path}: [robots.{name}] keep: wants an object store: give the relay --past file:///FOLDER "
                "or s3://BUCKET, or leave it out"
            )


def _robots(doc: Mapping[str, Any]) -> Robots:
    check_fields(doc, ("robots",), "the file")
    robots = doc.get("robots", {})
    if not isinstance(robots, dict):
        raise RobotsError("robots: want tables [robots.NAME]")
    return Robots({name: _enrolled(name, robot) for name, robot in robots.items()})


def _enrolled(name: str, doc: object) -> RobotEntry:
    where = f"[robots.{name}]"
    try:
        check_name("robot", name)
    except ValueError as e:
        raise RobotsError(str(e)) from None
    if not isinstance(doc, dict):
        raise RobotsError(f"{where}: want a table")
    check_fields(doc, ROBOT_FIELDS, where)
    secret, link_key = _secret(doc, "secret", where), _secret(doc, "link_key", where)
    rules = {a: _rule(doc[a.value], f"[robots.{name}.{a.value}]") for a in Audience if a.value in doc}
    delays_s: dict[str, float] = {}
    for rule in rules.values():
        if rule.delay_s > 0 and delays_s.setdefault(rule.view, rule.delay_s) != rule.delay_s:
            raise RobotsError(
                f"{where}: two delays for view {rule.view!r}: one is kept, for all who see it late"
            )
    keep_s = _read_keep_s(doc, rules, where)
    return RobotEntry(secret, _unix_s(doc, "expires", where), rules, link_key, keep_s)


def _read_keep_s(doc: Mapping[str, Any], rules: Mapping[Audience, Rule], where: str) -> float | None:
    """Read `keep`, and check each `past` that it bounds. Raises RobotsError."""
    keep_s = _duration_s(doc, "keep", where)
    if keep_s is None:
        return None
    if keep_s <= 0:
        raise RobotsError(f"{where} keep: to keep nothing, leave it out")
    for audience, rule in rules.items():
        if rule.past_s is not None and rule.past_s > keep_s:
            raise RobotsError(f"{where[:-1]}.{audience.value}] past: more than `keep`, {doc['keep']!r}")
    return keep_s


def _secret(doc: Mapping[str, Any], name: str, where: str) -> str | None:
    secret = doc.get(name)
    if secret is not None and not (isinstance(secret, str) and SECRET.fullmatch(secret)):
        raise RobotsError(f"{where} {name}: want one that `posecast-relay robots` made")
    return secret


def _rule(doc: object, where: str) -> Rule:
    if not isinstance(doc, dict):
        raise RobotsError(f"{where}: want a table")
    check_fields(doc, RULE_FIELDS, where)
    view, blackout, viewers = doc.get("view", PUBLIC), doc.get("blackout", False), doc.get("viewers")
    try:
        check_name("view", view if isinstance(view, str) else "")
    except ValueError as e:
        raise RobotsError(f"{where} {e}") from None
    if not isinstance(blackout, bool):
        raise RobotsError(f"{where} blackout: want true or false")
    if viewers is not None and (type(viewers) is not int or not 0 <= viewers <= 1_000_000):
        raise RobotsError(f"{where} viewers: want a whole number from 0 to 1000000")
    hz = _number(doc, "hz", 60.0, (0.1, 60.0), where)
    delay_s = _number(doc, "delay_s", 0.0, (0.0, DELAY_MAX_S), where)
    past_s = _duration_s(doc, "past", where)
    if past_s and hz < FULL_HZ:
        raise RobotsError(
            f"{where} past: it holds every frame, and `hz` may leave some out: show a slower view instead"
        )
    return Rule(view, hz, delay_s, viewers, blackout, _frames(doc, where), past_s)


def _frames(doc: Mapping[str, Any], where: str) -> tuple[str, ...] | None:
    frames = doc.get("frames")
    if frames is None:
        return None
    if not where.endswith(f".{Audience.ANYONE.value}]"):
        raise RobotsError(f"{where} frames: only for `anyone`: who asks for a frame proves nothing yet")
    if not isinstance(frames, list) or len(frames) > FRAMES_MAX:
        raise RobotsError(f"{where} frames: want a list of at most {FRAMES_MAX} origins")
    for n, origin in enumerate(frames, 1):
        if not isinstance(origin, str) or not ORIGIN.fullmatch(origin):
            raise RobotsError(f"{where} frames: number {n} is no origin like https://course.example")
    return tuple(frames)


def _number(
    doc: Mapping[str, Any], name: str, default: float, span: tuple[float, float], where: str
) -> float:
    value = doc.get(name, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not span[0] <= value <= span[1]:
        raise RobotsError(f"{where} {name}: want a number from {span[0]:g} to {span[1]:g}")
    return float(value)


def _duration_s(doc: Mapping[str, Any], name: str, where: str) -> float | None:
    value = doc.get(name)
    if value is None:
        return None
    if type(value) is int and value == 0:
        return 0.0
    found = DURATION.fullmatch(value) if isinstance(value, str) else None
    seconds = float(int(found[1]) * DURATION_UNITS_S[found[2]]) if found is not None else -1.0
    if not 0 <= seconds <= DURATION_MAX_S:
        zero = "" if name == "keep" else ", or 0"
        raise RobotsError(f'{where} {name}: want a time like "90s", "30m", "12h" or "30d"{zero}')
    return seconds


def format_duration(seconds: float) -> str:
    """Describe a time in the largest unit of which it is a whole number: 90 s, 30 min, 12 h, 3 d."""
    units = (("d", 86400), ("h", 3600), ("min", 60), ("s", 1))
    return next(
        (f"{seconds / size:g} {name}" for name, size in units if seconds % size == 0), f"{seconds:g} s"
    )


def _unix_s(doc: Mapping[str, Any], name: str, where: str) -> float:
    at = doc.get(name)
    if at is None:
        return float("inf")
    if not isinstance(at, datetime):
        raise RobotsError(f"{where} {name}: want a time like 2030-01-31T12:00:00Z")
    return (at if at.tzinfo else at.replace(tzinfo=UTC)).timestamp()


def check_fields(doc: Mapping[str, Any], names: tuple[str, ...], where: str) -> None:
    """Raise RobotsError for a field that is not in `names`, so that no misspelt limit is ignored."""
    for name in doc:
        if name not in names:
            shown = re.sub(r"[^\w-]", "?", name)[:60]
            raise RobotsError(f"{where}: unknown field {shown!r}: use {', '.join(names)}")
