"""Finds out why there is no link. Zenoh reports only a timeout, so this connects to the relay itself."""

from __future__ import annotations

import socket
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import zenoh
from posecast_wire.credential import Credential

from posecast_edge.uplink.credentials import Certificate
from posecast_edge.uplink.session import make_zenoh_config

if TYPE_CHECKING:
    import ssl

PATIENCE_S = 2.0
SILENT = "accepts connections but sends nothing: does it hang, or is it still starting?"
CREDENTIAL = "does it need a credential (--credential, in Python credential=)"
SURE_AFTER = 3  # attempts in a row that failed although the relay answered,
SURE_AFTER_S = 5.0  # over at least this time: a busy machine may be too slow once or twice


class Diagnosis(NamedTuple):
    """Why there is no link. `why`: the rest of a sentence that starts with the relay's name. `is_refusal`:
    the relay answers, so only this robot's credential can be the reason."""

    why: str
    is_refusal: bool = False


class RefusalPatience:
    """Decides when to conclude that a relay refuses this robot and is not just slow. Times are monotonic
    seconds."""

    def __init__(self) -> None:
        self._count = 0
        self._since_s = 0.0

    def is_sure(self, found: Diagnosis, now_s: float) -> bool:
        """Whether to report `found`, the diagnosis at `now_s`."""
        if not found.is_refusal:
            self._count = 0
            return True
        if self._count == 0:
            self._since_s = now_s
        self._count += 1
        return self._count >= SURE_AFTER and now_s - self._since_s >= SURE_AFTER_S


def diagnose_link(relay: str, credential: Credential | Certificate | None) -> Diagnosis:
    """Find out why there is no link to `relay`, a Zenoh endpoint such as `tls/host:port`."""
    scheme, _, address = relay.partition("/")
    host, _, port = address.rpartition(":")
    host = host.strip("[]")
    if scheme == "quic":
        return Diagnosis("does not answer, or refuses this robot")
    wrong = alert = None
    try:
        with socket.create_connection((host, int(port)), PATIENCE_S) as plain:
            if scheme == "tls":
                wrong, alert = shake_hands(plain, host, credential)
                if wrong == NO_TLS and _is_web(host, int(port)):
                    wrong = WEB
            else:
                wrong = _explain_answer(probe_port(plain), address)
    except (OSError, UnicodeError):  # UnicodeError: an invalid host name
        return Diagnosis("does not answer")
    if wrong is not None:
        return Diagnosis(wrong)
    if alert is None and scheme == "tcp" and isinstance(credential, Credential) and _takes_anybody(relay):
        return Diagnosis(
            "accepts robots without a credential, like a relay with --dev: remove the credential, or start "
            "the relay with --robots"
        )
    return Diagnosis(_refusal(credential, alert), alert is None)


def _takes_anybody(relay: str) -> bool:
    """Whether the relay accepts a robot without a credential: Zenoh refuses a password if none is needed."""
    try:
        with zenoh.open(make_zenoh_config(relay, tries_once=True)):
            return True
    except zenoh.ZError:
        return False


def _is_web(host: str, port: int) -> bool:
    """Whether a web server without TLS listens there."""
    with socket.create_connection((host, port), PATIENCE_S) as plain:
        return is_http(probe_port(plain))


def _explain_answer(answer: bytes | None, address: str) -> str | None:
    """What is wrong with a tcp/… endpoint that sends this answer; None when it may be a relay's."""
    if answer is None:
        return SILENT
    if is_http(answer):
        return WEB
    return f"requires TLS: use tls/{address}" if is_tls(answer) else None


def _refusal(credential: Credential | Certificate | None, alert: str | None) -> str:
    """Why a relay that answers refuses this robot."""
    if alert == "certificate required":
        return "requires a certificate from this robot: give --tls-cert and --tls-key"
    if alert is not None:
        return f"refuses this robot's certificate: {alert}"
    if credential is None:
        return "answers, but refuses this robot: " + CREDENTIAL + "?"
    if isinstance(credential, Certificate):
        return "answers, but refuses this robot: " + CREDENTIAL + " instead of a certificate?"
    return f"refuses {credential.robot!r}: its credential is wrong, expired or revoked"


# --- what listens there: Zenoh, a web server, TLS, or nothing

PROBE = bytes(2)  # an empty batch: Zenoh answers by closing, and the relay does not count a refusal
ANSWER_BYTES = 8  # enough to tell HTTP and TLS from Zenoh
HTTP, TLS_ALERT = b"HTTP/", b"\x15\x03"

WEB = (
    "is the port of a web page: use the relay's port for robots, 7447 by default; the relay prints it when "
    "it starts"
)


def probe_port(link: socket.socket) -> bytes | None:
    """The first bytes of the answer; b"" when the other side closes the connection; None when nothing arrives
    before the socket's timeout (the OS accepts connections even for a stopped process). Raises ssl.SSLError
    when the other side of a TLS link sends an alert."""
    try:
        link.sendall(PROBE)
        return link.recv(ANSWER_BYTES)
    except TimeoutError:
        return None
    except ConnectionError:  # an answer, too
        return b""


def is_http(answer: bytes | None) -> bool:
    """Whether a web server sent this answer."""
    return answer is not None and answer.startswith(HTTP)


def is_tls(answer: bytes | None) -> bool:
    """Whether a server that requires TLS sent this answer."""
    return answer is not None and answer.startswith(TLS_ALERT)


# --- TLS. The module ssl takes 5 MB, which an agent must not load just because the link is down: so only
# these functions import it

NO_TLS = "does not speak TLS: is it a tcp/… endpoint?"
ALERT_S = 1.0  # in TLS 1.3, the relay rejects our certificate only after the handshake


def shake_hands(
    plain: socket.socket, host: str, credential: Credential | Certificate | None
) -> tuple[str | None, str | None]:
    """Try a TLS handshake on a connected socket. Returns (what is wrong with the relay's TLS, why the relay
    rejects our certificate), each None if fine. Raises OSError when the relay does not answer."""
    import ssl  # noqa: PLC0415

    try:
        with _trust(credential).wrap_socket(plain, server_hostname=host) as link:
            return _hear(link)
    except ssl.SSLCertVerificationError as e:
        return f"has a certificate that can't be trusted: {e.verify_message.lower()}", None
    except ssl.SSLError:
        return NO_TLS, None


def _hear(link: ssl.SSLSocket) -> tuple[str | None, str | None]:
    """Like shake_hands, for an established link. An alert is returned in TLS's own words."""
    import ssl  # noqa: PLC0415

    link.settimeout(ALERT_S)
    try:
        link.recv(1)  # read first: if the relay closed on data from us, its alert could be lost
    except TimeoutError:  # it waits for our data
        with suppress(OSError):
            return (WEB if is_http(probe_port(link)) else None), None
    except ssl.SSLError as e:
        _, alert, words = (e.reason or "").partition("ALERT_")
        return None, words.replace("_", " ").lower() if alert else None
    except OSError:  # it closed the connection
        pass
    return None, None


def _trust(credential: Credential | Certificate | None) -> ssl.SSLContext:
    import ssl  # noqa: PLC0415

    if isinstance(credential, Certificate):
        context = ssl.create_default_context(cafile=credential.ca)
        with suppress(OSError):  # the files were valid when the agent started
            context.load_cert_chain(credential.chain, credential.key, password="")
        return context
    if credential is None or credential.ca is None:
        return ssl.create_default_context()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    with suppress(ssl.SSLError):  # then nothing is trusted, which the handshake reports
        context.load_verify_locations(cadata=credential.ca)
    return context
