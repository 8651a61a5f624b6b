"""Finds out why there is no link. Zenoh reports only a timeout, so this connects to the relay itself, step by
step: name, TCP or proxy, TLS, Zenoh, credential."""

from __future__ import annotations

import re
import socket
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

import zenoh
from posecast_wire.credential import Credential
from posecast_wire.keys import frame_key

from posecast_edge.kit import make_visible
from posecast_edge.uplink.credentials import Certificate, make_tls_context
from posecast_edge.uplink.route import ProxyError, RelayRoute
from posecast_edge.uplink.session import is_heard, make_zenoh_config
from posecast_edge.uplink.tunnel import Tunnel

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


class Step(NamedTuple):
    """A step on the way to the relay. `text`: what was found; if it `failed`, the rest of a sentence that
    starts with the relay's name."""

    name: str
    text: str
    failed: bool = False


def check_steps(route: RelayRoute, credential: Credential | Certificate | None) -> Iterator[Step]:
    """Go towards the relay, up to the first step that failed. The last one is that Zenoh answers; whether it
    accepts this robot is not asked."""
    asked = route.address if route.proxy is None else (route.proxy.host, route.proxy.port)
    try:
        found = socket.getaddrinfo(*asked, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):  # UnicodeError: an invalid host name
        whose = "its name" if route.proxy is None else "the proxy's name"
        yield Step("name", f"can't be reached: {whose} {asked[0]} is unknown here", failed=True)
        return
    addresses = sorted({str(address[0]) for *_, address in found})
    yield Step("name", f"{asked[0]} is {', '.join(addresses)}")
    if route.scheme == "quic":
        yield Step("QUIC", "not checked: it uses UDP")
        return
    hop = "TCP" if route.proxy is None else "proxy"
    try:
        with route.connect(PATIENCE_S) as plain:
            yield Step(hop, f"{asked[0]} port {asked[1]} connects")
            if route.scheme == "tls":
                yield from _check_tls(plain, route, credential)
            else:
                yield from _check_tcp(plain, route)
    except ProxyError as e:
        yield Step("proxy", str(e), failed=True)
    except (OSError, UnicodeError):
        yield Step(hop, "does not answer", failed=True)


def _check_tcp(plain: socket.socket, route: RelayRoute) -> Iterator[Step]:
    answer = probe_port(plain)
    wrong = None
    if answer is None:
        wrong = SILENT
    elif is_http(answer):
        wrong = WEB
    elif is_tls(answer):
        wrong = f"requires TLS: use tls/{route.endpoint.partition('/')[2]}"
    yield Step("Zenoh", wrong or "answers", failed=wrong is not None)


def diagnose_link(route: RelayRoute, credential: Credential | Certificate | None) -> Diagnosis:
    """Find out why there is no link to the relay."""
    for step in check_steps(route, credential):
        if step.failed:
            return Diagnosis(step.text)
    if route.scheme == "quic":
        return Diagnosis("does not answer, or refuses this robot")
    if route.scheme == "tcp" and isinstance(credential, Credential) and _takes_anybody(route):
        return Diagnosis(
            "accepts robots without a credential, like a relay with --dev: remove the credential, or start "
            "the relay with --robots"
        )
    return Diagnosis(_refusal(credential), is_refusal=True)


def check_credential(
    route: RelayRoute, credential: Credential | Certificate | None, robot: str | None
) -> Step:
    """Whether a relay that answers accepts this robot, asked by Zenoh. `robot`: its name; None if nothing
    says it, so only the link is checked."""
    warnings: list[str] = []
    tunnel = Tunnel(route, warnings.append) if route.needs_tunnel else None
    try:
        endpoint = route.endpoint if tunnel is None else tunnel.open(credential)
        with zenoh.open(make_zenoh_config(endpoint, credential)) as session:
            if robot is None or is_heard(session, frame_key(robot, "public")):
                who = "this robot" if robot is None else f"'{robot}'"
                return Step("credential", f"accepts {who}")
            return Step("credential", f"does not know {robot!r}, or the certificate has another name", True)
    except zenoh.ZError:
        return Step("credential", diagnose_link(route, credential).why, failed=True)
    finally:
        if tunnel is not None:
            tunnel.close()


def _takes_anybody(route: RelayRoute) -> bool:
    """Whether the relay accepts a robot without a credential: Zenoh refuses a password if none is needed."""
    try:
        with zenoh.open(make_zenoh_config(route.endpoint, tries_once=True)):
            return True
    except zenoh.ZError:
        return False


def _refusal(credential: Credential | Certificate | None) -> str:
    """Why a relay that answers refuses this robot."""
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
ALERT = re.compile(r"(?:\S+_ALERT|TLSV1)_(.+)")  # OpenSSL's names for what the other side said


def _check_tls(
    plain: socket.socket, route: RelayRoute, credential: Credential | Certificate | None
) -> Iterator[Step]:
    """Shake hands on a connected socket, and listen for what the relay says of our certificate."""
    import ssl  # noqa: PLC0415

    try:
        with make_tls_context(credential).wrap_socket(plain, server_hostname=route.expected_name) as link:
            yield Step("TLS", f"{link.version()}, {_describe(link.getpeercert())}")
            yield _hear(link)
    except ssl.SSLCertVerificationError as e:
        yield Step("TLS", _explain_untrusted(route, e.verify_message), failed=True)
    except ssl.SSLError as e:
        alert = _find_alert(e)
        if alert is None:
            yield Step("TLS", WEB if _is_web(route) else NO_TLS, failed=True)
        else:
            yield Step("TLS", _explain_alert(route, alert), failed=True)
    except TimeoutError:
        yield Step("TLS", SILENT, failed=True)
    except OSError:
        text = "ends the connection instead of speaking TLS: a firewall, or the wrong port?"
        yield Step("TLS", text, failed=True)


def _hear(link: ssl.SSLSocket) -> Step:
    """What the relay says after the handshake."""
    import ssl  # noqa: PLC0415

    link.settimeout(ALERT_S)
    try:
        link.recv(1)  # read first: if the relay closed on data from us, its alert could be lost
    except TimeoutError:  # it waits for our data
        with suppress(OSError):
            if is_http(probe_port(link)):
                return Step("Zenoh", WEB, failed=True)
    except ssl.SSLError as e:
        alert = _find_alert(e)
        if alert == "certificate required":
            needs = "requires a certificate from this robot: give --tls-cert and --tls-key"
            return Step("credential", needs, failed=True)
        if alert is not None:
            return Step("credential", f"refuses this robot's certificate: {alert}", failed=True)
    except OSError:  # it closed the connection
        pass
    return Step("Zenoh", "answers")


def _is_web(route: RelayRoute) -> bool:
    """Whether a web server without TLS listens there."""
    with suppress(OSError), route.connect(PATIENCE_S) as plain:
        return is_http(probe_port(plain))
    return False


def _find_alert(error: ssl.SSLError) -> str | None:
    """The other side's alert in TLS's own words; None if it sent none."""
    match = ALERT.fullmatch(error.reason or "")
    return match and match[1].replace("_", " ").lower()


def _explain_alert(route: RelayRoute, alert: str) -> str:
    host = route.expected_name
    text = f"speaks TLS, but refuses connections to {host} ({alert})"
    if re.fullmatch(r"[0-9.]+|.*:.*", host):  # TLS sends names only
        return f"{text}: use its name instead of an address, or give the name with --relay-name"
    return f"{text}: use a name in its certificate"


def _explain_untrusted(route: RelayRoute, why: str) -> str:
    """Why the certificate is not trusted, and whose it is."""
    text = f"has a certificate that can't be trusted: {why.lower().rstrip('.')}"
    with suppress(OSError, ValueError, UnicodeError):
        text += f". It is the {_describe(_fetch_certificate(route))}"
    if route.proxy is not None:
        text += ". Is it the proxy's? A proxy must not open this connection"
    return text


def _fetch_certificate(route: RelayRoute) -> dict[str, Any] | None:
    """The relay's certificate, unverified. Python decodes only what it has verified: so it is fetched, and
    then trusted on a second connection, on which nothing is sent."""
    import ssl  # noqa: PLC0415

    def make_context() -> ssl.SSLContext:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname = False
        return context

    first = make_context()
    first.verify_mode = ssl.CERT_NONE
    with (
        route.connect(PATIENCE_S) as plain,
        first.wrap_socket(plain, server_hostname=route.expected_name) as link,
    ):
        found = link.getpeercert(binary_form=True)
    second = make_context()
    second.verify_flags |= ssl.VerifyFlags.VERIFY_X509_PARTIAL_CHAIN
    second.load_verify_locations(cadata=found or b"")
    with (
        route.connect(PATIENCE_S) as plain,
        second.wrap_socket(plain, server_hostname=route.expected_name) as link,
    ):
        return link.getpeercert()


NAMES_MAX = 4


def _describe(certificate: dict[str, Any] | None) -> str:
    """Whose certificate it is, in the form of ssl.SSLSocket.getpeercert, and who issued it."""
    if not certificate:
        return "certificate of an unknown name"
    names = [name for _, name in certificate.get("subjectAltName", ())] or [_name(certificate["subject"])]
    shown = ", ".join(names[:NAMES_MAX]) + (", …" if len(names) > NAMES_MAX else "")
    text = f"certificate of {shown}, issued by {_name(certificate['issuer'])}"
    return make_visible(f"{text}, valid until {certificate['notAfter']}", 300)


def _name(of: Any) -> str:
    """The common name of a subject or issuer, or else its organisation's."""
    parts = dict(part for group in of for part in group)
    return str(parts.get("commonName") or parts.get("organizationName") or "nobody")
