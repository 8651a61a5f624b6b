"""Finds out why there is no link. Zenoh reports only a timeout, so this connects to the relay itself."""

from __future__ import annotations

import socket
from typing import NamedTuple

import zenoh
from posecast_wire.credential import Credential

from posecast_edge.uplink.certificate import Certificate
from posecast_edge.uplink.knock import WEB, is_http, is_tls, knock
from posecast_edge.uplink.session_config import make_zenoh_config

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
                # imports ssl, 5 MB that an agent must not load just because the link is down
                from posecast_edge.uplink.diagnosis_tls import NO_TLS, shake_hands  # noqa: PLC0415

                wrong, alert = shake_hands(plain, host, credential)
                if wrong == NO_TLS and _is_web(host, int(port)):
                    wrong = WEB
            else:
                wrong = _explain_answer(knock(plain), address)
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
        return is_http(knock(plain))


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
