"""Opens the relay's Zenoh session, the router to which robots connect.

Zenoh reads its users, their rights and its certificates only when a session opens. So when a robot is
enrolled or revoked, the relay replaces this session, and all robots connect again. The next session is
complete before the present one closes: it lacks only the port. So robots find it at their first try, and a
session that can't be opened changes nothing.

The last valid versions of the router's certificate and of the authority for robots are kept. When they
expire is read from the files, because Python's `ssl` tells that only of a peer's certificate. Zenoh reports
publishers that it refused only in its own log, on stdout.
"""

from __future__ import annotations

import asyncio
import base64
import binascii
import contextlib
import errno
import json
import logging
import os
import re
import secrets
import socket
import ssl
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import zenoh
from posecast_wire.keys import PREFIX

from posecast_relay.runtime.port_holder import explain_taken

log = logging.getLogger("posecast_relay")

LEASE_MS = 2500  # a robot counts as gone this long after its link breaks
PORT_TRIES = 5
PORT_MS = 2000  # how long the next session waits for the port
PORT_RETRY = {"period_init_ms": 2, "period_max_ms": 2, "period_increase_factor": 1}
READY_S = 0.005  # how often to check whether it lacks only that
FOLDER_LETTERS_MAX = 75  # the path of a socket may have 103, and the folder's own name comes on top
MESSAGE_BYTES_MAX = 1 << 21  # an answer with the largest schema, plus some
PENDING_MAX = 64  # unauthenticated links at once; with more, Zenoh delays all others
ACCEPT_MS = 2000  # time to authenticate, so that silent links free their places
SESSIONS_MAX = 4000  # robots; Zenoh's default is 1,000


class ListenError(OSError):
    """The session can't be opened. The message is one line that names the endpoint or the file."""


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

    shared = add("*", "egress", OUT_OF_ALL, "")  # no robot can have this name: Zenoh refuses equal ids
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
    folder: Path | None = None,
) -> zenoh.Config:
    """`folder`: for a file through which Zenoh reads the access control four times as fast. It holds the GIL
    meanwhile, for half a second with 1,000 robots, and a relay that serves can't wait that long.
    """
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
        access_control = {"access_control": make_access_control(sorted(auth.secrets), known_by)}
        if folder is None:
            settings |= access_control
        else:
            file = folder / "access_control.yaml"  # JSON is YAML
            file.write_text(json.dumps(access_control))
            config = zenoh.Config.from_file(str(file))
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
            with _passwords(auth) as passwords:
                return zenoh.open(_config(real, auth, passwords, certificates)), real
        except zenoh.ZError as e:
            if tries_left and real != list(endpoints):
                continue
            raise _refused(real, e) from None
    raise AssertionError("unreachable")


def _refused(endpoints: Sequence[str], error: zenoh.ZError) -> ListenError:
    """Make an error from Zenoh's message, without its source location."""
    reason = str(error).splitlines()[0].partition(" at /")[0]
    if "in use" in reason:
        taken = OSError(errno.EADDRINUSE, "address already in use")
        reason = explain_taken(taken, int(endpoints[0].rpartition(":")[2]))
    return ListenError(f"zenoh listener {', '.join(endpoints)}: {reason}")


def _no_file(error: OSError) -> ListenError:
    folder = tempfile.tempdir or "the folder for temporary files"
    return ListenError(f"{folder}: {(error.strerror or str(error)).lower()}")


def close_session(session: zenoh.Session) -> threading.Thread:
    """Begin to close a session, and return the thread that does it. The port is free within milliseconds, but
    a robot that reads nothing delays the end by many seconds.
    """

    def close() -> None:
        with contextlib.suppress(zenoh.ZError):
            session.close()  # type: ignore[no-untyped-call]

    closing = threading.Thread(target=close, daemon=True, name="closing")
    closing.start()
    return closing


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
    """The relay's session as a Zenoh router. It is replaced when its users or certificates change."""

    def __init__(self, endpoints: Sequence[str], auth: ZenohAuth | None) -> None:
        """Raises ListenError if it can't listen on an endpoint, CertificateError if a certificate can't be
        used. `auth` None: anybody may publish.
        """
        self._auth = auth
        self._certificates = None if auth is None else RouterCertificates(auth.cert, auth.key, auth.ca)
        self.session, self.endpoints = open_router(endpoints, auth, self._certificates)
        self.is_listening = True
        self._tls = None if self._certificates is None else self._certificates.make_settings()
        # by the flag that names the file; of the certificates in use, which may differ from the present files
        self.expiries_s = _read_expiries(auth)
        self._changing = asyncio.Lock()

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
        one is open. Raises ListenError if it can't be opened; call this again later. Meanwhile either the old
        one is still open, or `is_listening` is False and nobody can publish.
        """
        async with self._changing:
            before, certificates = self._auth, self._certificates
            if before is None or certificates is None:
                return
            await asyncio.to_thread(certificates.refresh)
            tls = certificates.make_settings()
            if self.is_listening and (before.secrets, self._tls) == (secrets, tls):
                return
            now, is_renewed = replace(before, secrets=secrets), self._tls != tls
            self.session = await self._replace(now, certificates, closing)
            self._auth, self._tls, self.is_listening = now, tls, False
            opened()
            self.is_listening = True
            if certificates.trouble is None:
                self.expiries_s = _read_expiries(now)
            came = sorted(secrets.keys() - before.secrets.keys())
            went = sorted(before.secrets.keys() - secrets.keys())
            new = sorted(r for r in secrets.keys() & before.secrets.keys() if secrets[r] != before.secrets[r])
            if is_renewed:
                log.warning("using the renewed certificates")
            for what, robots in (("enrolled", came), ("revoked", went), ("with a new credential", new)):
                if robots:
                    log.warning("publishers %s: %s", what, ", ".join(robots[:20]))

    async def _replace(
        self, auth: ZenohAuth, certificates: RouterCertificates, closing: Callable[[], None]
    ) -> zenoh.Session:
        """Open the next session, and close the present one when the next one lacks only the port."""
        with contextlib.ExitStack() as files:
            config, ready = await asyncio.to_thread(self._prepare, auth, certificates, files)
            opening = asyncio.create_task(asyncio.to_thread(zenoh.open, config))
            while not (opening.done() or ready.exists()):
                await asyncio.sleep(READY_S)
            try:
                if opening.done():
                    opening.result()
            except zenoh.ZError as e:
                raise _refused(self.endpoints, e) from None
            closing()
            close_session(self.session)
            with contextlib.suppress(zenoh.ZError):
                return await opening
        self.is_listening = False
        try:  # once more, because Zenoh does not say why it has waited in vain
            return (await asyncio.to_thread(open_router, self.endpoints, auth, certificates))[0]
        except OSError as e:
            raise ListenError(f"robots can't connect: {e}") from None

    def _prepare(
        self, auth: ZenohAuth, certificates: RouterCertificates, files: contextlib.ExitStack
    ) -> tuple[zenoh.Config, Path]:
        """Return the next session's settings, and a path that exists once it lacks only the port.

        Zenoh opens its listeners in order and waits for each of them, when all else is done. So the first one
        is a socket in a folder of our own, which goes with `files` before anybody could connect to it.
        """
        try:
            parent = tempfile.gettempdir() if len(tempfile.gettempdir()) < FOLDER_LETTERS_MAX else "/tmp"
            made = tempfile.TemporaryDirectory(prefix="posecast-", dir=parent, ignore_cleanup_errors=True)
            folder = Path(files.enter_context(made))
            passwords = files.enter_context(_passwords(auth))
            ready = folder / "ready"
            endpoints = [f"unixsock-stream/{ready}", *self.endpoints]
            config = _config(endpoints, auth, passwords, certificates, folder)
        except OSError as e:
            raise _no_file(e) from None
        config.insert_json5("listen/timeout_ms", json.dumps(PORT_MS))
        config.insert_json5("listen/retry", json.dumps(PORT_RETRY))
        return config, ready


FILE_BYTES_MAX = 1 << 20  # an authority's file may hold hundreds of certificates
TLS = "transport/link/tls"  # prefix of Zenoh's settings


class CertificateError(ValueError):
    """A certificate file can't be used. The message is one line that names it."""


class RouterCertificates:
    """The content of `--zenoh-tls-cert`, `--zenoh-tls-key` and `--zenoh-ca` when all were last valid.

    Zenoh gets the bytes, not the files, so that a file damaged meanwhile can't prevent a new session.
    """

    def __init__(self, cert: Path | None, key: Path | None, ca: Path | None) -> None:
        """Raises CertificateError if a file can't be used."""
        self._cert, self._key, self._ca = cert, key, ca
        self._kept: dict[str, bytes] = {}
        self._kept = self._read()
        self.trouble: str | None = None  # the files' present problem

    def refresh(self) -> bool:
        """Read the files again. Return whether they have changed and are valid. Otherwise the last valid
        content is kept.
        """
        try:
            read = self._read()
        except CertificateError as e:
            if str(e) != self.trouble:
                log.warning("%s; the last good certificates stay in force", e)
            self.trouble = str(e)
            return False
        if self.trouble is not None:
            self.trouble = None
            log.warning("certificates are valid again")
        is_new = read != self._kept
        self._kept = read
        return is_new

    def make_settings(self) -> dict[str, Any]:
        """Return Zenoh's settings with these certificates."""
        return _make_settings(self._kept)

    def _read(self) -> dict[str, bytes]:
        """Read and check all files, by their names in Zenoh's settings. Raises CertificateError."""
        found: dict[str, bytes] = {}
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        if self._cert is not None and self._key is not None:
            found["listen_certificate"] = _read_file("--zenoh-tls-cert", self._cert)
            found["listen_private_key"] = _read_file("--zenoh-tls-key", self._key)
            try:
                context.load_cert_chain(self._cert, self._key, password="")
            except OSError:  # ssl.SSLError is one
                raise CertificateError(
                    f"--zenoh-tls-cert {self._cert}, --zenoh-tls-key {self._key}: not a valid pair"
                ) from None
        if self._ca is not None:
            found["root_ca_certificate"] = _read_file("--zenoh-ca", self._ca)
            try:
                context.load_verify_locations(self._ca)
            except OSError:
                raise CertificateError(f"--zenoh-ca {self._ca}: no certificate in PEM form") from None
        if found != self._kept and "listen_certificate" in found:
            try:
                _try_out(found)
            except zenoh.ZError as e:  # it knows fewer kinds of keys than Python: no P-521
                why = str(e).splitlines()[0].partition(" at /")[0]
                raise CertificateError(
                    f"--zenoh-tls-cert {self._cert}, --zenoh-tls-key {self._key}: Zenoh can't use them: {why}"
                ) from None
        return found


def _make_settings(certificates: dict[str, bytes]) -> dict[str, Any]:
    return {f"{TLS}/{name}_base64": base64.b64encode(data).decode() for name, data in certificates.items()}


def _try_out(certificates: dict[str, bytes]) -> None:
    """Listen with these certificates for some milliseconds, on a port of this machine. Raises ZError."""
    config = zenoh.Config()
    settings: dict[str, Any] = {
        "mode": "router",
        "listen/endpoints": ["tls/127.0.0.1:0"],
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,
        "transport/shared_memory/enabled": False,
        f"{TLS}/enable_mtls": "root_ca_certificate" in certificates,
        **_make_settings(certificates),
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    zenoh.open(config).close()  # type: ignore[no-untyped-call]


def _read_file(flag: str, path: Path) -> bytes:
    try:
        if not path.is_file():
            path.stat()  # raises if there is nothing
            raise CertificateError(f"{flag} {path}: is not a file")
        with path.open("rb") as file:
            return file.read(FILE_BYTES_MAX)
    except OSError as e:
        raise CertificateError(f"{flag} {path}: {(e.strerror or str(e)).lower()}") from None


SEQUENCE, UTC_TIME, GENERALIZED_TIME, VERSION = 0x30, 0x17, 0x18, 0xA0
_PEM = re.compile(rb"-----BEGIN CERTIFICATE-----(.*?)-----END CERTIFICATE-----", re.DOTALL)


def read_expiry(path: Path) -> float:
    """Return when the first of a PEM file's certificates expires, in unix seconds.

    Raises OSError if the file can't be read, ValueError if it contains no certificate.
    """
    with path.open("rb") as file:
        text = file.read(FILE_BYTES_MAX)
    try:
        found = [_find_expiry(base64.b64decode(block)) for block in _PEM.findall(text)]
    except (binascii.Error, IndexError, UnicodeDecodeError):
        raise ValueError(f"{path}: contains a certificate that can't be read") from None
    if not found:
        raise ValueError(f"{path}: contains no certificate")
    return min(found)


def _find_expiry(der: bytes) -> float:
    """Return `notAfter` of one certificate (RFC 5280 §4.1) in unix seconds.

    Raises ValueError or IndexError if it is not a certificate.
    """
    at = _enter(der, _enter(der, 0))  # Certificate, then tbsCertificate
    if der[at] == VERSION:
        at = _skip(der, at)
    for _ in ("serialNumber", "signature", "issuer"):
        at = _skip(der, at)
    not_after = _skip(der, _enter(der, at))  # validity: notBefore, notAfter
    begin, end = _measure(der, not_after)
    form = {UTC_TIME: "%y%m%d%H%M%SZ", GENERALIZED_TIME: "%Y%m%d%H%M%SZ"}.get(der[not_after])
    if form is None:
        raise ValueError("no time where a certificate has one")
    found = datetime.strptime(der[begin:end].decode("ascii"), form).replace(tzinfo=UTC)
    if form.startswith("%y") and found.year >= 2050:  # in RFC 5280 "50" is 1950; in strptime, 2050
        found = found.replace(year=found.year - 100)
    return found.timestamp()


def _measure(der: bytes, at: int) -> tuple[int, int]:
    """Return where the content of the element at `at` begins and ends. Raises ValueError or IndexError."""
    size, begin = der[at + 1], at + 2
    if size & 0x80:
        count = size & 0x7F
        size, begin = int.from_bytes(der[begin : begin + count], "big"), begin + count
    if begin + size > len(der):
        raise ValueError("an element that is longer than the certificate")
    return begin, begin + size


def _enter(der: bytes, at: int) -> int:
    if der[at] != SEQUENCE:
        raise ValueError("no certificate")
    return _measure(der, at)[0]


def _skip(der: bytes, at: int) -> int:
    return _measure(der, at)[1]


SAY_S = 10.0  # between two lines: clients may retry fast
LOG = "off,zenoh_transport::unicast::establishment::accept=debug,zenoh_link_tls::unicast=debug"
OF_ZENOH = re.compile("zenoh_transport|zenoh_link_tls")
REFUSAL_LINE = re.compile(
    r"establishment::accept.*UsrPwd extension.*(Invalid user|Invalid password|Expected extension)"
    r"|link_tls::unicast.*(peer sent no certificates|invalid peer certificate)"
)
MEANINGS = {
    "Invalid user": "unknown robot, or its credential has expired",
    "Invalid password": "its credential is wrong or was replaced",
    "Expected extension": "it sent no credential",
    "peer sent no certificates": "it sent no certificate",
    "invalid peer certificate": "its certificate has expired, or is from another authority",
}
NAMED = re.compile(r"link_tls::unicast.*Accepted TLS connection .*Common Name: (.*)\.\s*$")
STRANGER = "the robots file does not list the common name of its certificate"


class AuthFailures:
    """Counts publishers that Zenoh refused, and sometimes logs one.

    Make one per process, before Zenoh writes its first line. It reads the process's stdout, and passes on all
    lines that are not from Zenoh.
    """

    def __init__(self, may_publish: Callable[[str], bool] | None) -> None:
        """`may_publish` returns whether a publisher with a certificate of this name may publish; None if
        publishers use passwords, so that the certificate's name does not matter.
        """
        self.count = 0
        self._may_publish = may_publish
        self._said_at = float("-inf")
        self._stdout = os.dup(1)
        listen, stdout_end = os.pipe()
        sys.stdout.flush()
        os.dup2(stdout_end, 1)
        os.close(stdout_end)
        sys.stdout = os.fdopen(os.dup(self._stdout), "w", buffering=1)
        zenoh.init_log_from_env_or(LOG)
        threading.Thread(target=self._read, args=(listen,), daemon=True, name="refusals").start()

    def _read(self, listen: int) -> None:
        with os.fdopen(listen, "rb") as lines:
            for raw in lines:
                line = raw.decode("utf-8", "replace")
                if OF_ZENOH.search(line) is None:  # not from Zenoh
                    os.write(self._stdout, raw)
                elif (refusal := REFUSAL_LINE.search(line)) is not None:
                    self.record_refusal(MEANINGS[refusal[1] or refusal[2]], time.monotonic())
                elif self._may_publish is not None:
                    named = NAMED.search(line)
                    if named is not None and not self._may_publish(named[1]):
                        self.record_refusal(STRANGER, time.monotonic())  # access control denies it everything

    def record_refusal(self, why: str, now: float) -> None:
        """Count a refused publisher, and log `why` at most once in SAY_S seconds. `now` is in seconds."""
        self.count += 1
        if now - self._said_at >= SAY_S:
            self._said_at = now
            log.warning("publisher refused (%d so far): %s", self.count, why)
