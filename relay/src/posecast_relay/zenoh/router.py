"""Opens the relay's Zenoh session, the router to which robots connect.

Zenoh reads its users and their rights only when a session opens. So when a robot is enrolled or revoked, the
relay closes only this session and opens a new one.
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

LEASE_MS = 2500  # a robot counts as gone this long after its link breaks
PORT_TRIES = 5
REOPEN_S = 5.0  # how long to retry the port that was just closed
MESSAGE_BYTES_MAX = 1 << 21  # an answer with the largest schema, plus some
PENDING_MAX = 64  # unauthenticated links at once; with more, Zenoh delays all others
ACCEPT_MS = 2000  # time to authenticate, so that silent links free their places
SESSIONS_MAX = 4000  # robots; Zenoh's default is 1,000


class ListenError(OSError):
    """The listener can't be opened. The message is one line that names the endpoint."""


@dataclass(frozen=True)
class ZenohAuth:
    """Who may publish: `secrets` by robot. With `cert` and its `key`, endpoints may be `tls/…`.

    With `ca`, robots must show a certificate of this authority with their name as its common name. Then there
    are no passwords, and the secrets are empty.
    """

    secrets: Mapping[str, str] = field(repr=False)
    cert: Path | None = None
    key: Path | None = None
    ca: Path | None = None


# What an agent may send and receive on the keys of its own robot ({}). Everything else is denied. Zenoh has
# no patterns for users, so each user needs separate rules.
Rights = Mapping[tuple[str, ...], tuple[str, ...]]  # kinds of messages → keys
IN_OF_ONE: Rights = {
    ("put",): ("{}/*/frame", "{}/*/event"),
    ("liveliness_token",): ("{}/alive",),
    ("declare_queryable", "reply"): ("{}/*/snapshot", "{}/model/**"),
    ("query",): ("{}/echo",),
}
OUT_OF_ONE: Rights = {("query",): ("{}/*/snapshot", "{}/model/**"), ("reply",): ("{}/echo",)}
# The relay's subscriptions, which reveal no robot's state. An agent sends only when it sees them.
OUT_OF_ALL: Rights = {
    ("declare_subscriber",): ("*/*/frame", "*/*/event"),
    ("declare_queryable",): ("*/echo",),
    ("declare_liveliness_subscriber", "liveliness_query"): ("*/alive",),
}


def make_access_control(robots: Sequence[str], known_by: str = "usernames") -> dict[str, Any]:
    """Make Zenoh's `access_control`: each robot may use only its own keys.

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
        "scouting/delay": 0,  # otherwise opening takes half a second
        "transport/link/tx/lease": LEASE_MS,
        "transport/unicast/max_sessions": SESSIONS_MAX,
        "transport/unicast/accept_pending": PENDING_MAX,
        "transport/unicast/accept_timeout": ACCEPT_MS,
        "transport/link/rx/max_message_size": MESSAGE_BYTES_MAX,  # default: 1 GB; larger messages are dropped
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
    """Write the file of `user:password` lines that Zenoh reads when it opens. Delete it at the end."""
    if auth is None or auth.ca is not None:
        yield None
        return
    # an empty file would let everybody in; no robot's name can begin with -
    lines = [f"{robot}:{secret}" for robot, secret in auth.secrets.items()]
    lines.append(f"-:{secrets.token_urlsafe(32)}")
    with tempfile.NamedTemporaryFile("w", prefix="posecast-") as file:
        os.fchmod(file.fileno(), 0o600)
        file.write("\n".join(lines) + "\n")
        file.flush()
        yield file.name


def _with_port(endpoint: str) -> str:
    """Replace port 0 with a port that is free now, because Zenoh does not report which one it chose."""
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
    """Open a session. Return it with the endpoints that it listens on. `auth` None: anybody may publish.

    Raises ListenError if the session can't listen on an endpoint.
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
    """Make an error from Zenoh's message, without its source location."""
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
    """Open a session with new users on endpoints just closed. Raises ListenError after REOPEN_S seconds."""
    give_up_at = time.monotonic() + REOPEN_S
    while True:
        try:
            return _open(endpoints, auth, certificates)
        except zenoh.ZError as e:
            if time.monotonic() >= give_up_at:
                raise _refused(endpoints, e) from None
            time.sleep(0.01)


def _read_expiries(auth: ZenohAuth | None) -> dict[str, float]:
    """Return when the session's certificates expire (unix seconds), by flag."""
    files = {} if auth is None else {"--zenoh-tls-cert": auth.cert, "--zenoh-ca": auth.ca}
    found: dict[str, float] = {}
    for flag, path in files.items():
        with contextlib.suppress(OSError, ValueError):  # Zenoh accepts a format that we can't read
            if path is not None:
                found[flag] = read_expiry(path)
    return found


class RouterSession:
    """The relay's session as a Zenoh router. Changing its users closes it for some milliseconds."""

    def __init__(self, endpoints: Sequence[str], auth: ZenohAuth | None) -> None:
        """Raises ListenError if it can't listen on an endpoint, CertificateError if a certificate can't be
        used. `auth` None: anybody may publish.
        """
        self._auth = auth
        self._certificates = None if auth is None else RouterCertificates(auth.cert, auth.key, auth.ca)
        self.session, self.endpoints = open_router(endpoints, auth, self._certificates)
        # by the flag that names the file; of the certificates in use, which may differ from the present files
        self.expiries_s = _read_expiries(auth)
        self._changing = asyncio.Lock()
        self.changes = 0

    def lets_in(self, robot: str) -> bool:
        """Return whether this robot may publish now."""
        return self._auth is None or robot in self._auth.secrets

    @property
    def trouble(self) -> str | None:
        """The certificate files' present problem, which keeps the previous ones in use; None without one."""
        return None if self._certificates is None else self._certificates.trouble

    async def admit(
        self, secrets: dict[str, str], closing: Callable[[], None], opened: Callable[[], None]
    ) -> None:
        """Let only these robots publish, by name and secret, and use the present certificates.

        If this needs a new session, `closing` is called before the old one closes, and `opened` when the new
        one is open. If it can't be opened, this logs an error, and nobody can publish until the next change.
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
            except ListenError as e:  # nobody can publish until the next change, which tries again
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
