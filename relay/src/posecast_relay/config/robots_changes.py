"""Edits the text of the robots file (`--robots`), and keeps its comments and order. Does no I/O."""

from __future__ import annotations

import re
import secrets
from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any

import tomlkit
from posecast_wire import Credential
from tomlkit.items import InlineTable

from posecast_relay.config.robots_reader import RULE_FIELDS, RobotsError, parse_robots
from posecast_relay.config.settings import SettingsError
from posecast_relay.core.policy import PUBLIC, Audience, make_link

HEAD = (
    "Who can publish and who can watch. A running relay applies changes within a second. "
    "See docs/SECURITY.md."
)
NOTHING = "nothing"  # what an audience without a table sees
TEXTS = ("view",)  # fields whose value is text even if it looks like a number
HEADER = re.compile(r"""^[ \t]*\[[ \t]*(robots|"robots"|'robots')[ \t]*\.""", re.MULTILINE)  # [robots.NAME]


class RobotsDocument:
    """The file's content, to be changed. A change that can't be made raises SettingsError, with one line."""

    def __init__(self, text: str | None, name: str) -> None:
        """`text`: the file's text; None or empty if it does not exist yet. `name`: its name in messages.
        Raises RobotsError, with lines that begin with that name, if the text is already invalid.
        """
        self._name = name
        if text is None or not text.strip():
            self._doc = tomlkit.document()
            self._doc.add(tomlkit.comment(HEAD))
        else:
            try:
                parse_robots(text)
            except RobotsError as e:
                raise RobotsError(*(f"{name}: {mistake}" for mistake in e.mistakes)) from None
            self._doc = tomlkit.parse(text)
        if "robots" not in self._doc:
            self._doc["robots"] = tomlkit.table(is_super_table=True)
        self._robots: Any = self._doc["robots"]
        # robots are written as `hubo = { … }` or `hubo.secret = "…"`: TOML allows no [header] among these
        self._is_flat = bool(self._robots) and HEADER.search(text or "") is None

    def make_text(self) -> str:
        """Return the text of the file. It is never empty: a relay would treat that as half written."""
        text = tomlkit.dumps(self._doc)
        return text if text.strip() else f"# {HEAD}\n"

    def add_robot(self, robot: str, is_private: bool, expires: datetime | None, ca: str | None) -> Credential:
        """Let a robot publish with a new credential. Anyone sees its view `public` unless `is_private`."""
        if "secret" in self._robots.get(robot, {}):
            raise SettingsError(f"robot {robot!r} already has a credential: `rotate` makes a new one")
        self._enrol(robot, is_private, expires)
        return self._set_secret(robot, ca)

    def add_certified_robot(self, robot: str, is_private: bool, expires: datetime | None) -> None:
        """Let a robot publish with a certificate whose common name is the robot's name."""
        self._enrol(robot, is_private, expires)

    def rotate_secret(self, robot: str, expires: datetime | None, ca: str | None) -> Credential:
        """Give a robot a new credential, valid at once; the old one stops working."""
        self._set_expires(self._find(robot), expires)
        self._robots[robot].pop("next_secret", None)
        return self._set_secret(robot, ca)

    def has_begun_rotation(self, robot: str) -> bool:
        """Whether a robot has a next credential."""
        return "next_secret" in self._robots.get(robot, {})

    def begin_rotation(self, robot: str, ca: str | None) -> Credential:
        """Make a robot's next credential, which does not work until `finish_rotation`."""
        if "secret" not in self._find(robot):
            raise SettingsError(f"robot {robot!r} uses a certificate, so it has no credential to rotate")
        credential = Credential(robot, secrets.token_urlsafe(32), ca)
        self._robots[robot]["next_secret"] = credential.secret
        return credential

    def finish_rotation(self, robot: str, expires: datetime | None) -> None:
        """Replace a robot's credential with its next one."""
        of = self._find(robot)
        if "next_secret" not in of:
            raise SettingsError(f"no rotation of {robot!r} has begun: run `robots rotate {robot} --begin`")
        self._set_expires(of, expires)
        of["secret"] = of.pop("next_secret")

    def remove_robot(self, robot: str) -> None:
        """Remove a robot."""
        self._find(robot)
        del self._robots[robot]

    def set_rules(self, robot: str, keep: str | None, audiences: Mapping[Audience, Sequence[str]]) -> None:
        """Set who can watch what. Fields look like `delay_s=10`; an empty value, as in `delay_s=`, removes
        the field. The single word `nothing` instead of fields shows that audience nothing. `keep`: how long
        the past stays in the object store; "0": it is not kept there.
        """
        of = self._find(robot)
        if keep == "0":
            of.pop("keep", None)
        elif keep is not None:
            of["keep"] = keep
        for audience, fields in audiences.items():
            if list(fields) == [NOTHING]:
                of.pop(audience.value, None)
                continue
            changes = [_read_field(audience, field) for field in fields]
            if audience.value not in of:
                if all(value is None for _, value in changes):
                    continue  # an empty table would show the default view to an audience that saw nothing
                self._add_table(of, audience.value)
            for name, value in changes:
                if value is None:
                    of[audience.value].pop(name, None)
                else:
                    of[audience.value][name] = value

    def make_share_link(self, robot: str, until: datetime) -> str:
        """Return the token of a new share link. Makes the key that signs it if the robot has none."""
        of = self._find(robot)
        if Audience.LINK.value not in of:
            raise SettingsError(
                f"no [robots.{robot}.link] in {self._name}: set what its links show, for example with "
                f"`robots set {robot} --link view={PUBLIC}`"
            )
        if "link_key" not in of:
            of["link_key"] = secrets.token_urlsafe(32)
        return make_link(str(of["link_key"]), robot, int(until.timestamp()), secrets.token_urlsafe(6))

    def revoke_share_links(self, robot: str) -> None:
        """Revoke all share links of a robot."""
        self._find(robot)["link_key"] = secrets.token_urlsafe(32)

    def set_admin_secret(self, networks: Sequence[str] | None) -> str:
        """Make the credential for the page `/admin`, and return it. `networks`: where it can be used, in
        addition to the relay's own machine; None leaves them as they are.
        """
        if "admin" not in self._doc:
            self._doc["admin"] = tomlkit.table()
        admin: Any = self._doc["admin"]
        admin["secret"] = secrets.token_urlsafe(32)
        if networks is not None:
            admin["networks"] = list(networks)
        return str(admin["secret"])

    def _find(self, robot: str) -> Any:
        if robot not in self._robots:
            raise SettingsError(f"no robot {robot!r} in {self._name}")
        return self._robots[robot]

    def _enrol(self, robot: str, is_private: bool, expires: datetime | None) -> None:
        if robot not in self._robots:
            self._add_table(self._robots, robot)
            if not is_private:
                self._add_table(self._robots[robot], Audience.ANYONE.value)
                self._robots[robot][Audience.ANYONE.value]["view"] = PUBLIC
        self._set_expires(self._robots[robot], expires)

    def _add_table(self, parent: Any, name: str) -> None:
        is_inline = self._is_flat or isinstance(parent, InlineTable)
        parent[name] = tomlkit.inline_table() if is_inline else tomlkit.table()

    @staticmethod
    def _set_expires(of: Any, expires: datetime | None) -> None:
        of.pop("expires", None)
        if expires is not None:
            of["expires"] = expires.replace(microsecond=0)

    def _set_secret(self, robot: str, ca: str | None) -> Credential:
        credential = Credential(robot, secrets.token_urlsafe(32), ca)
        self._robots[robot]["secret"] = credential.secret
        return credential


def expire_in_days(now: datetime, days: int | None) -> datetime | None:
    """Return the time `days` after `now`; None for None, which never expires."""
    return None if days is None else now + timedelta(days=days)


def _read_field(audience: Audience, text: str) -> tuple[str, Any]:
    """Read `NAME=VALUE`; the value is None if nothing follows the sign."""
    name, sign, value = text.partition("=")
    option = f"--{audience.value} {text}"
    if not sign or name not in RULE_FIELDS:
        raise SettingsError(f"{option}: use FIELD=VALUE, fields {', '.join(RULE_FIELDS)}; or {NOTHING!r}")
    if not value:
        return name, None
    if name == "frames":
        return name, value.split(",")
    if name not in TEXTS:
        for read in (int, float):
            try:
                return name, read(value)
            except ValueError:
                continue
    return name, {"true": True, "false": False}.get(value, value)
