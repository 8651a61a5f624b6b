"""Counts and logs publishers that Zenoh refused. Zenoh reports them only in its own log, on stdout."""

from __future__ import annotations

import logging
import os
import re
import sys
import threading
import time
from collections.abc import Callable

import zenoh

log = logging.getLogger("posecast_relay")

SAY_S = 10.0  # between two lines: clients may retry fast
LOG = "off,zenoh_transport::unicast::establishment::accept=debug,zenoh_link_tls::unicast=debug"
OF_ZENOH = re.compile("zenoh_transport|zenoh_link_tls")
SAID = re.compile(
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
        listen, said = os.pipe()
        sys.stdout.flush()
        os.dup2(said, 1)
        os.close(said)
        sys.stdout = os.fdopen(os.dup(self._stdout), "w", buffering=1)
        zenoh.init_log_from_env_or(LOG)
        threading.Thread(target=self._read, args=(listen,), daemon=True, name="refusals").start()

    def _read(self, listen: int) -> None:
        with os.fdopen(listen, "rb") as lines:
            for raw in lines:
                line = raw.decode("utf-8", "replace")
                if OF_ZENOH.search(line) is None:  # not from Zenoh
                    os.write(self._stdout, raw)
                elif (said := SAID.search(line)) is not None:
                    self.record_refusal(MEANINGS[said[1] or said[2]], time.monotonic())
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
