"""Changes the text of the file of `--robots` as a command asks for, comments and order kept. Does no I/O."""

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
from posecast_relay.core.policy.policy import PUBLIC, Audience
from posecast_relay.core.policy.share_link import make_link

HEAD = "Who may publish and who may watch. A running relay follows within a second. See docs/SECURITY.md."
NOTHING = "nothing"  # what an audience without a table sees
TEXTS = ("view",)  # fields whose value is text even where it looks like a number
HEADER = re.compile(r"""^[ \t]*\[[ \t]*(robots|"robots"|'robots')[ \t]*\.""", re.MULTILINE)  # [robots.NAME]


class RobotsDocument:
    """The file as it is to be. Each change raises SettingsError, one line, where it can't be made."""

    def __init__(self, text: str | None, name: str) -> None:
        """`text`: of the file; None or an empty one: there is none yet. `name`: of the file, for messages.
        Raises RobotsError, whose lines begin with that name, where the text is wrong already: what the relay
        would refuse is not to be built upon.
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
        # robots written as `hubo = { … }` or `hubo.secret = "…"`: a table with a header can't be among them
        self._is_flat = bool(self._robots) and HEADER.search(text or "") is None

    def make_text(self) -> str:
        """Return the text of the file, never an empty one: a relay takes that for one half written."""
        text = tomlkit.dumps(self._doc)
        return text if text.strip() else f"# {HEAD}\n"

    def add_robot(self, robot: str, is_private: bool, expires: datetime | None, ca: str | None) -> Credential:
        """Let a robot publish by a new credential; anyone sees its view `public` unless `is_private`."""
        if "secret" in self._robots.get(robot, {}):
            raise SettingsError(f"robot {robot!r} has a credential already: `rotate` makes a new one")
        self._enrol(robot, is_private, expires)
        return self._set_secret(robot, ca)

    def add_certified_robot(self, robot: str, is_private: bool, expires: datetime | None) -> None:
        """Let a robot publish by a certificate that bears its name."""
        self._enrol(robot, is_private, expires)

    def rotate_secret(self, robot: str, expires: datetime | None, ca: str | None) -> Credential:
        """Give a robot a new credential, valid at once; the old one is not any more."""
        self._set_expires(self._find(robot), expires)
        self._robots[robot].pop("next_secret", None)
        return self._set_secret(robot, ca)

    def has_begun_rotation(self, robot: str) -> bool:
        """Whether a robot has a next credential."""
        return "next_secret" in self._robots.get(robot, {})

    def begin_rotation(self, robot: str, ca: str | None) -> Credential:
        """Make a robot's next credential, which is worth nothing until `finish_rotation`."""
        if "secret" not in self._find(robot):
            raise SettingsError(f"robot {robot!r} shows a certificate, and has no credential to rotate")
        credential = Credential(robot, secrets.token_urlsafe(32), ca)
        self._robots[robot]["next_secret"] = credential.secret
        return credential

    def finish_rotation(self, robot: str, expires: datetime | None) -> None:
        """Put a robot's next credential in the place of the one that it has."""
        of = self._find(robot)
        if "next_secret" not in of:
            raise SettingsError(f"no rotation of {robot!r} was begun: `robots rotate {robot} --begin`")
        self._set_expires(of, expires)
        of["secret"] = of.pop("next_secret")

    def remove_robot(self, robot: str) -> None:
        """Forget a robot."""
        self._find(robot)
        del self._robots[robot]

    def set_rules(self, robot: str, keep: str | None, audiences: Mapping[Audience, Sequence[str]]) -> None:
        """Say who may watch what: fields as `delay_s=10`; one with nothing behind `=` is left out from then
        on. The one word `nothing` in place of fields: that audience sees nothing. `keep`: how long the past
        stays in the store, "0" for not at all.
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
                    continue  # an empty table would show the default view to whoever has seen nothing so far
                self._add_table(of, audience.value)
            for name, value in changes:
                if value is None:
                    of[audience.value].pop(name, None)
                else:
                    of[audience.value][name] = value

    def make_share_link(self, robot: str, until: datetime) -> str:
        """Return the token of a new share link. Makes the key that signs it, where there is none."""
        of = self._find(robot)
        if Audience.LINK.value not in of:
            raise SettingsError(
                f"no [robots.{robot}.link] in {self._name}: say what its links show, as by "
                f"`robots set {robot} --link view={PUBLIC}`"
            )
        if "link_key" not in of:
            of["link_key"] = secrets.token_urlsafe(32)
        return make_link(str(of["link_key"]), robot, int(until.timestamp()), secrets.token_urlsafe(6))

    def revoke_share_links(self, robot: str) -> None:
        """End all share links of a robot."""
        self._find(robot)["link_key"] = secrets.token_urlsafe(32)

    def set_admin_secret(self, networks: Sequence[str] | None) -> str:
        """Make the credential for the page `/admin`, and return it. `networks`: from where it may be used,
        beside the relay's own machine; None: as it was.
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
    """Return when something ends that is good for so many days; None: never."""
    return None if days is None else now + timedelta(days=days)


def _read_field(audience: Audience, text: str) -> tuple[str, Any]:
    """Read `NAME=VALUE`; the value is None where nothing stands behind the sign."""
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
