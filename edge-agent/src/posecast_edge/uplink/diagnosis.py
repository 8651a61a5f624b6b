"""Finds out why there is no link. Zenoh reports only a timeout, so this connects to the relay by other
means."""

from __future__ import annotations

import socket

from posecast_wire.credential import Credential

from posecast_edge.uplink.certificate import Certificate

PATIENCE_S = 2.0
KNOCK = bytes(2)  # an empty batch: Zenoh says goodbye to it, and the relay counts nobody as refused


def diagnose_link(relay: str, credential: Credential | Certificate | None) -> str:
    """Say what is wrong, as text to be appended to the relay's name. `relay`: a Zenoh endpoint,
    `tls/host:port`."""
    scheme, _, address = relay.partition("/")
    host, _, port = address.rpartition(":")
    host = host.strip("[]")
    if scheme == "quic":
        return "does not answer, or does not let this robot in"
    wrong = alert = None
    try:
        with socket.create_connection((host, int(port)), PATIENCE_S) as plain:
            if scheme == "tls":
                # brings ssl, 5 MB that an agent whose link is merely away must not take
                from posecast_edge.uplink.diagnosis_tls import shake_hands  # noqa: PLC0415

                wrong, alert = shake_hands(plain, host, credential)
            elif not _speaks(plain):
                return "takes connections and says nothing: does it hang, or is it just starting?"
    except (OSError, UnicodeError):  # also of a name that is none
        return "does not answer"
    return wrong or _refusal(credential, alert)


def _speaks(link: socket.socket) -> bool:
    """Whether somebody is behind it: a system takes connections also for a process that stands still."""
    try:
        link.sendall(KNOCK)
        link.recv(1)
    except TimeoutError:
        return False
    except OSError:  # it hangs up: a word, too
        pass
    return True


def _refusal(credential: Credential | Certificate | None, alert: str | None) -> str:
    """What a relay that answers has against this robot."""
    if alert == "certificate required":
        return "wants a certificate of this robot: give --tls-cert and --tls-key"
    if alert is not None:
        return f"does not take this robot's certificate: {alert}"
    if credential is None:
        return "answers, but does not let this robot in: does it want a --credential?"
    if isinstance(credential, Certificate):
        return "answers, but does not let this robot in: does it want a --credential, not a certificate?"
    return f"does not let {credential.robot!r} in: its credential is wrong, expired or revoked"
