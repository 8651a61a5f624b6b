"""The TLS part of `diagnosis.py`, a separate module because importing it costs five megabytes that few
need."""

from __future__ import annotations

import socket
import ssl
from contextlib import suppress

from posecast_wire.credential import Credential

from posecast_edge.uplink.certificate import Certificate

ALERT_S = 1.0  # TLS 1.3: whether the relay takes our certificate shows after the handshake


def shake_hands(
    plain: socket.socket, host: str, credential: Credential | Certificate | None
) -> tuple[str | None, str | None]:
    """Try a TLS handshake on a connected socket. Returns (what is wrong with the relay's TLS, why the
    relay rejects ours), None for each that is fine. Raises OSError when the relay does not answer."""
    try:
        with _trust(credential).wrap_socket(plain, server_hostname=host) as link:
            return None, _alert(link)
    except ssl.SSLCertVerificationError as e:
        return f"shows a certificate that is not to be trusted: {e.verify_message.lower()}", None
    except ssl.SSLError:
        return "does not speak TLS: is it a tcp/… endpoint?", None


def _alert(link: ssl.SSLSocket) -> str | None:
    """What the relay has against our certificate, in TLS's words; None when it says nothing."""
    link.settimeout(ALERT_S)
    try:
        link.recv(1)
    except ssl.SSLError as e:
        _, alert, words = (e.reason or "").partition("ALERT_")
        return words.replace("_", " ").lower() if alert else None
    except OSError:  # it waits for us, or has closed
        pass
    return None


def _trust(credential: Credential | Certificate | None) -> ssl.SSLContext:
    if isinstance(credential, Certificate):
        context = ssl.create_default_context(cafile=credential.ca)
        with suppress(OSError):  # they were good when the agent started
            context.load_cert_chain(credential.chain, credential.key, password="")
        return context
    if credential is None or credential.ca is None:
        return ssl.create_default_context()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    with suppress(ssl.SSLError):  # then nothing is trusted, and that is what will be said
        context.load_verify_locations(cadata=credential.ca)
    return context
