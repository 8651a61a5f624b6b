"""Finds out why there is no link. Zenoh reports only a timeout, so this connects to the relay by other
means."""

from __future__ import annotations

import socket
from typing import NamedTuple

import zenoh
from posecast_wire.credential import Credential

from posecast_edge.uplink.certificate import Certificate
from posecast_edge.uplink.knock import WEB, is_http, is_tls, knock
from posecast_edge.uplink.session_config import make_zenoh_config

PATIENCE_S = 2.0
SILENT = "takes connections and says nothing: does it hang, or is it just starting?"
CREDENTIAL = "does it want a credential (--credential, in Python credential=)"
SURE_AFTER = 3  # times in a row that a relay which answers made no link,
SURE_AFTER_S = 5.0  # and for so long: a busy machine may be too slow once or twice


class Diagnosis(NamedTuple):
    """Why there is no link: `why` goes on after the relay's name. `is_refusal`: the relay answers, so nothing
    else than what this robot shows it can be the reason."""

    why: str
    is_refusal: bool = False


class RefusalPatience:
    """Decides when a relay counts as one that refuses this robot, and is not just slow. Times are monotonic
    seconds."""

    def __init__(self) -> None:
        self._count = 0
        self._since_s = 0.0

    def is_sure(self, found: Diagnosis, now_s: float) -> bool:
        """Whether to tell what was found at `now_s`."""
        if not found.is_refusal:
            self._count = 0
            return True
        if self._count == 0:
            self._since_s = now_s
        self._count += 1
        return self._count >= SURE_AFTER and now_s - self._since_s >= SURE_AFTER_S


def diagnose_link(relay: str, credential: Credential | Certificate | None) -> Diagnosis:
    """Find out what is wrong. `relay`: a Zenoh endpoint, `tls/host:port`."""
    scheme, _, address = relay.partition("/")
    host, _, port = address.rpartition(":")
    host = host.strip("[]")
    if scheme == "quic":
        return Diagnosis("does not answer, or does not let this robot in")
    wrong = alert = None
    try:
        with socket.create_connection((host, int(port)), PATIENCE_S) as plain:
            if scheme == "tls":
                # brings ssl, 5 MB that an agent whose link is merely away must not take
                from posecast_edge.uplink.diagnosis_tls import NO_TLS, shake_hands  # noqa: PLC0415

                wrong, alert = shake_hands(plain, host, credential)
                if wrong == NO_TLS and _is_web(host, int(port)):
                    wrong = WEB
            else:
                wrong = _explain_answer(knock(plain), address)
    except (OSError, UnicodeError):  # also of a name that is none
        return Diagnosis("does not answer")
    if wrong is not None:
        return Diagnosis(wrong)
    if alert is None and scheme == "tcp" and isinstance(credential, Credential) and _takes_anybody(relay):
        return Diagnosis(
            "takes robots without a credential, as a relay does with --dev: leave the credential out, or "
            "start the relay with --robots"
        )
    return Diagnosis(_refusal(credential, alert), alert is None)


def _takes_anybody(relay: str) -> bool:
    """Whether a robot that shows nothing is let in: Zenoh refuses a password where none is asked for."""
    try:
        with zenoh.open(make_zenoh_config(relay, tries_once=True)):
            return True
    except zenoh.ZError:
        return False


def _is_web(host: str, port: int) -> bool:
    """Whether a web server without TLS listens there."""
    with socket.create_connection((host, port), PATIENCE_S) as plain:
        return is_http(knock(plain))


def _explain_answer(answer: bytes | None, address: str) -> str | None:
    """What is wrong with a tcp/… endpoint that answers so; None when it may be a relay's."""
    if answer is None:
        return SILENT
    if is_http(answer):
        return WEB
    return f"wants TLS: it is tls/{address}" if is_tls(answer) else None


def _refusal(credential: Credential | Certificate | None, alert: str | None) -> str:
    """What a relay that answers has against this robot."""
    if alert == "certificate required":
        return "wants a certificate of this robot: give --tls-cert and --tls-key"
    if alert is not None:
        return f"does not take this robot's certificate: {alert}"
    if credential is None:
        return "answers, but does not let this robot in: " + CREDENTIAL + "?"
    if isinstance(credential, Certificate):
        return "answers, but does not let this robot in: " + CREDENTIAL + ", not a certificate?"
    return f"does not let {credential.robot!r} in: its credential is wrong, expired or revoked"
