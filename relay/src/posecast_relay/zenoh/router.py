"""Opens the relay's own Zenoh session: it is the router that edges connect to.

Zenoh reads its users and their rights only when a session is opened. So when a robot is enrolled or revoked,
the session, and nothing else, is closed and opened anew.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import json
import logging
import os
import secrets
import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import zenoh
from posecast_wire.keys import PREFIX

from posecast_relay.port_holder import explain_taken
from posecast_relay.zenoh.certificate_expiry import read_expiry
from posecast_relay.zenoh.certificates import RouterCertificates

log = logging.getLogger("posecast_relay")

LEASE_MS = 2500  # an edge whose link is cut is gone after this long
PORT_TRIES = 5
REOPEN_S = 5.0  # the port we have just let go of is tried again for so long
MESSAGE_BYTES_MAX = 1 << 21  # an answer with the largest schema, and some room
PENDING_MAX = 64  # links that have not said who they are; with more, Zenoh holds up the others while they end
ACCEPT_MS = 2000  # and so long: silent ones make room for who comes
SESSIONS_MAX = 4000  # edges; Zenoh's own figure is 1,000


class ListenError(OSError):
    """The listener can't be opened. The message is one line that names the endpoint."""


@dataclass(frozen=True)
class ZenohAuth:
    """Who may publish: `secrets` by robot. With `cert` and its `key`, endpoints may be `tls/…`.

    With `ca`, robots show a certificate of this authority whose common name is theirs. Then no password is
    asked for, and the secrets are empty.
    """

    secrets: Mapping[str, str] = field(repr=False)
    cert: Path | None = None
    key: Path | None = None
    ca: Path | None = None


# What an edge may do with the keys of its own robot ({}), and what it is told. Everything else is denied.
# Zenoh knows no patterns for users, so there are rules for each.
Rights = Mapping[tuple[str, ...], tuple[str, ...]]  # kinds of messages → keys
IN_OF_ONE: Rights = {
    ("put",): ("{}/*/frame", "{}/*/event"),
    ("liveliness_token",): ("{}/alive",),
    ("declare_queryable", "reply"): ("{}/*/snapshot", "{}/model/**"),
    ("query",): ("{}/echo",),
}
OUT_OF_ONE: Rights = {("query",): ("{}/*/snapshot", "{}/model/**"), ("reply",): ("{}/echo",)}
# What the relay listens for: not of anybody's state. Without it an edge would not begin to send.
OUT_OF_ALL: Rights = {
    ("declare_subscriber",): ("*/*/frame", "*/*/event"),
    ("declare_queryable",): ("*/echo",),
    ("declare_liveliness_subscriber", "liveliness_query"): ("*/alive",),
}


def make_access_control(robots: Sequence[str], known_by: str = "usernames") -> dict[str, Any]:
    """Make Zenoh's `access_control`: each robot may use its own keys, and nothing else.

    Zenoh knows a robot by `known_by`: "usernames" or "cert_common_names".
    """
    rules: list[dict[str, Any]] = []

    def add(name: str, flow: str, rights: Rights, of: str) -> list[str]:
        made = []
        for n, (messages, keys) in enumerate(rights.items()):
            made.append(f"{name}-{flow}-{n}")
            exprs = [f"{PREFIX}/{key.format(of)}" for key in keys]
            rules.append(
                {"id": made[-1], "permission": "allow", "flows": [flow], "messages": [*messages]}
                | {"key_exprs": exprs}
            )
        return made

    shared = add("all", "egress", OUT_OF_ALL, "")
    policies = []
    for robot in robots:
        own = [*add(robot, "ingress", IN_OF_ONE, robot), *add(robot, "egress", OUT_OF_ONE, robot)]
        policies.append({"rules": shared + own, "subjects": [robot]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": robot, known_by: [robot]} for robot in robots],
        "policies": policies,
    }


def _config(
    endpoints: Sequence[str],
    auth: ZenohAuth | None,
    passwords: str | None,
    certificates: RouterCertificates | None,
) -> zenoh.Config:
    config = zenoh.Config()
    settings: dict[str, Any] = {
        "mode": "router",
        "listen/endpoints": list(endpoints),
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,  # else opening takes half a second
        "transport/link/tx/lease": LEASE_MS,
        "transport/unicast/max_sessions": SESSIONS_MAX,
        "transport/unicast/accept_pending": PENDING_MAX,
        "transport/unicast/accept_timeout": ACCEPT_MS,
        "transport/link/rx/max_message_size": MESSAGE_BYTES_MAX,  # else a gigabyte: a larger one is dropped
        "transport/shared_memory/enabled": False,  # drops messages silently under load
        "adminspace/enabled": False,
    }
    if auth is not None:
        known_by = "usernames" if auth.ca is None else "cert_common_names"
        settings["access_control"] = make_access_control(sorted(auth.secrets), known_by)
        if passwords is not None:
            settings["transport/auth/usrpwd/dictionary_file"] = passwords
        if auth.ca is not None:
            settings["transport/link/tls/enable_mtls"] = True
            settings["transport/link/tls/close_link_on_expiration"] = True
    if certificates is not None:
        settings |= certificates.make_settings()
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


@contextlib.contextmanager
def _passwords(auth: ZenohAuth | None) -> Iterator[str | None]:
    """Write the file of `user:password` lines that Zenoh reads when it opens; delete it at the end."""
    if auth is None or auth.ca is not None:
        yield None
        return
    # an empty file would let everybody in; no robot's name begins with -
    lines = [f"{robot}:{secret}" for robot, secret in auth.secrets.items()]
    lines.append(f"-:{secrets.token_urlsafe(32)}")
    with tempfile.NamedTemporaryFile("w", prefix="posecast-") as file:
        os.fchmod(file.fileno(), 0o600)
        file.write("\n".join(lines) + "\n")
        file.flush()
        yield file.name


def _with_port(endpoint: str) -> str:
    """Replace port 0 by one that is free just now, since Zenoh does not say which one it took."""
    scheme, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    if port != "0":
        return endpoint
    family = socket.AF_INET6 if host.startswith("[") else socket.AF_INET
    with socket.socket(family) as probe:
        probe.bind((host.strip("[]"), 0))
        return f"{scheme}/{host}:{probe.getsockname()[1]}"


def open_router(
    endpoints: Sequence[str], auth: ZenohAuth | None = None, certificates: RouterCertificates | None = None
) -> tuple[zenoh.Session, list[str]]:
    """Return a session and the endpoints that it listens on. `auth` None: anybody may publish.

    Raises ListenError when an endpoint can't be listened on.
    """
    for tries_left in reversed(range(PORT_TRIES)):
        real = [_with_port(e) for e in endpoints]
        try:
            return _open(real, auth, certificates), real
        except zenoh.ZError as e:
            if tries_left and real != list(endpoints):
                continue
            raise _refused(real, e) from None
    raise AssertionError("unreachable")


def _refused(endpoints: Sequence[str], error: zenoh.ZError) -> ListenError:
    """Make an error of Zenoh's message, without the place in its sources."""
    said = str(error).splitlines()[0].partition(" at /")[0]
    if "in use" in said:
        taken = OSError(errno.EADDRINUSE, "address already in use")
        said = explain_taken(taken, int(endpoints[0].rpartition(":")[2]))
    return ListenError(f"zenoh listener {', '.join(endpoints)}: {said}")


def _open(
    endpoints: Sequence[str], auth: ZenohAuth | None, certificates: RouterCertificates | None
) -> zenoh.Session:
    with _passwords(auth) as passwords:
        return zenoh.open(_config(endpoints, auth, passwords, certificates))


def reopen_router(
    endpoints: Sequence[str], auth: ZenohAuth, certificates: RouterCertificates | None = None
) -> zenoh.Session:
    """Open a session for other users on endpoints just closed. Raises ListenError after REOPEN_S seconds."""
    give_up_at = time.monotonic() + REOPEN_S
    while True:
        try:
            return _open(endpoints, auth, certificates)
        except zenoh.ZError as e:
            if time.monotonic() >= give_up_at:
                raise _refused(endpoints, e) from None
            time.sleep(0.01)


def _read_expiries(auth: ZenohAuth | None) -> dict[str, float]:
    """Return when the certificates of a session just opened expire (unix seconds), by flag."""
    files = {} if auth is None else {"--zenoh-tls-cert": auth.cert, "--zenoh-ca": auth.ca}
    found: dict[str, float] = {}
    for flag, path in files.items():
        with contextlib.suppress(OSError, ValueError):  # Zenoh has read it, so this is a form that we don't
            if path is not None:
                found[flag] = read_expiry(path)
    return found


class RouterSession:
    """The relay's session as a Zenoh router. A change of its users closes it for some milliseconds."""

    def __init__(self, endpoints: Sequence[str], auth: ZenohAuth | None) -> None:
        """Raises ListenError when an endpoint can't be listened on, CertificateError when a certificate can't
        be used. `auth` None: anybody may publish.
        """
        self._auth = auth
        self._certificates = None if auth is None else RouterCertificates(auth.cert, auth.key, auth.ca)
        self.session, self.endpoints = open_router(endpoints, auth, self._certificates)
        # by the flag that names the file; of what is in use, which need not be what the file holds by now
        self.expiries_s = _read_expiries(auth)
        self._changing = asyncio.Lock()
        self.changes = 0

    def lets_in(self, robot: str) -> bool:
        """Return whether this robot may publish now."""
        return self._auth is None or robot in self._auth.secrets

    @property
    def trouble(self) -> str | None:
        """What is wrong with the files of certificates now, so that those of before go on; None: nothing."""
        return None if self._certificates is None else self._certificates.trouble

    async def admit(
        self, secrets: dict[str, str], closing: Callable[[], None], opened: Callable[[], None]
    ) -> None:
        """Let these robots publish, by name and secret, and no others; show the certificates of now.

        If that takes a new session, `closing` is called before the old one closes, `opened` when the new one
        is open. If it can't be opened, that is logged, and nobody may publish until the next change.
        """
        async with self._changing:
            before, certificates = self._auth, self._certificates
            if before is None or certificates is None:
                return
            is_renewed = await asyncio.to_thread(certificates.refresh)
            if before.secrets == secrets and not is_renewed:
                return
            closing()
            self._auth = replace(before, secrets=secrets)
            try:
                self.session = await asyncio.to_thread(self._change, self.session, self._auth)
            except ListenError as e:  # nobody may publish meanwhile; the next change tries again
                self._auth = replace(before, secrets={})
                log.error("%s", e)
                return
            self.changes += 1
            opened()
            if certificates.trouble is None:
                self.expiries_s = _read_expiries(self._auth)
            came = sorted(secrets.keys() - before.secrets.keys())
            went = sorted(before.secrets.keys() - secrets.keys())
            new = sorted(r for r in secrets.keys() & before.secrets.keys() if secrets[r] != before.secrets[r])
            if is_renewed:
                log.warning("using the renewed certificates")
            for what, robots in (("enrolled", came), ("revoked", went), ("with a new credential", new)):
                if robots:
                    log.warning("publishers %s: %s", what, ", ".join(robots[:20]))

    def _change(self, session: zenoh.Session, auth: ZenohAuth) -> zenoh.Session:
        session.close()  # type: ignore[no-untyped-call]
        return reopen_router(self.endpoints, auth, self._certificates)
