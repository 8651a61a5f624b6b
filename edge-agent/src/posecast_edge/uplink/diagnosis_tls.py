"""The TLS part of `diagnosis.py`: a separate module, because importing it costs 5 MB of memory."""

from __future__ import annotations

import socket
import ssl
from contextlib import suppress

from posecast_wire.credential import Credential

from posecast_edge.uplink.certificate import Certificate
from posecast_edge.uplink.knock import WEB, is_http, knock

NO_TLS = "does not speak TLS: is it a tcp/… endpoint?"
ALERT_S = 1.0  # in TLS 1.3, the relay rejects our certificate only after the handshake


def shake_hands(
    plain: socket.socket, host: str, credential: Credential | Certificate | None
) -> tuple[str | None, str | None]:
    """Try a TLS handshake on a connected socket. Returns (what is wrong with the relay's TLS, why the relay
    rejects our certificate), each None if fine. Raises OSError when the relay does not answer."""
    try:
        with _trust(credential).wrap_socket(plain, server_hostname=host) as link:
            return _hear(link)
    except ssl.SSLCertVerificationError as e:
        return f"has a certificate that can't be trusted: {e.verify_message.lower()}", None
    except ssl.SSLError:
        return NO_TLS, None


def _hear(link: ssl.SSLSocket) -> tuple[str | None, str | None]:
    """Like shake_hands, for an established link. An alert is returned in TLS's own words."""
    link.settimeout(ALERT_S)
    try:
        link.recv(1)  # read first: if the relay closed on data from us, its alert could be lost
    except TimeoutError:  # it waits for our data
        with suppress(OSError):
            return (WEB if is_http(knock(link)) else None), None
    except ssl.SSLError as e:
        _, alert, words = (e.reason or "").partition("ALERT_")
        return None, words.replace("_", " ").lower() if alert else None
    except OSError:  # it closed the connection
        pass
    return None, None


def _trust(credential: Credential | Certificate | None) -> ssl.SSLContext:
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
