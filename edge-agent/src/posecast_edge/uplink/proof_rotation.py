"""Switches to a new credential or certificate while the agent runs: opens a second session with it, which
takes over once the relay listens to it."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

import zenoh

from posecast_edge.kit import ExceptionLog
from posecast_edge.uplink.credential_file import Proof
from posecast_edge.uplink.proof_watcher import ProofWatcher
from posecast_edge.uplink.session_config import make_zenoh_config

log = logging.getLogger("posecast_edge.link")

LOOK_S = 1.0
AGAIN_S = 60.0  # the relay counts and may log each failed attempt
LISTENER_S = 2.0  # with a wrong name in a valid certificate, the link opens but the relay does not listen
POLL_S = 0.01


class ProofRotation:
    """Watches the files of `proof` in a separate thread. Its methods return at once."""

    def __init__(
        self,
        relay: str,
        proof: Proof | None,
        key: str,
        is_linked: Callable[[], bool],
        opened: Callable[[], None],
        exceptions: ExceptionLog,
    ) -> None:
        """`key`: the relay listens on it to robots that it accepts; `is_linked`: whether the link with the
        old credential is up; `opened` is called when a session is ready to `take`."""
        self._relay, self._key = relay, key
        self._is_linked, self._opened = is_linked, opened
        self._exceptions = exceptions
        self._watcher = ProofWatcher(proof, log.warning)
        self._used = proof
        self._next: Proof | None = None  # new, and not in use yet
        self._try_at_s = 0.0
        self._session: tuple[zenoh.Session, Proof] | None = None
        self._lock = threading.Condition()
        self._hurries = self._stopping = False
        self.thread: threading.Thread | None = None

    def start(self) -> None:
        """Start watching, if there are files."""
        if self._watcher.has_files:
            self.thread = threading.Thread(target=self._run, name="credential", daemon=True)
            self.thread.start()

    def stop(self) -> None:
        """End the thread, and close a session that was not taken."""
        with self._lock:
            self._stopping = True
            self._lock.notify_all()
        found = self.take()
        if found is not None:
            found[0].close()  # type: ignore[no-untyped-call]

    def hurry(self) -> None:
        """Try at once: the link was lost, so the relay may accept the new credential now."""
        with self._lock:
            self._hurries = True
            self._lock.notify_all()

    def take(self) -> tuple[zenoh.Session, Proof] | None:
        """Hand over the opened session and its credential, once. The caller closes it."""
        with self._lock:
            found, self._session = self._session, None
            return found

    def _run(self) -> None:
        while not self._stopping:
            with self._lock:
                self._lock.wait_for(
                    lambda: self._stopping or (self._hurries and self._next is not None), LOOK_S
                )
                hurries, self._hurries = self._hurries, False
            try:
                self._look()
                hurries = hurries or not self._is_linked()
                if self._next is not None and (hurries or time.monotonic() >= self._try_at_s):
                    self._try(self._next, tries_once=not hurries)
            except Exception as e:
                self._exceptions.add("a new credential", e)

    def _look(self) -> None:
        found = self._watcher.check()
        if found is not None:
            # a renewed certificate is the same object, with new bytes in its files
            self._next = None if found == self._used and found is not self._used else found
            self._try_at_s = 0.0

    def _try(self, proof: Proof, tries_once: bool) -> None:
        is_first, self._try_at_s = self._try_at_s == 0.0, time.monotonic() + AGAIN_S
        session = self._open(proof, tries_once)
        if session is None:
            if is_first:
                log.warning(
                    "the relay does not accept the new credential yet: keeping the previous one until it does"
                )
            return
        with self._lock:
            unwanted: zenoh.Session | None = session
            if not self._stopping:
                unwanted = None if self._session is None else self._session[0]
                self._session = session, proof
        if unwanted is not None:
            unwanted.close()  # type: ignore[no-untyped-call]
        self._used, self._next = proof, None
        log.warning("the new credential is in use")
        self._opened()

    def _open(self, proof: Proof, tries_once: bool) -> zenoh.Session | None:
        """A session that the relay listens to; None when it does not listen."""
        try:
            session = zenoh.open(make_zenoh_config(self._relay, proof, tries_once))
        except zenoh.ZError:
            return None
        probe = session.declare_publisher(self._key)
        until_s = time.monotonic() + LISTENER_S
        while not probe.matching_status.matching:  # type: ignore[attr-defined]
            if self._stopping or time.monotonic() > until_s:
                session.close()  # type: ignore[no-untyped-call]
                return None
            time.sleep(POLL_S)
        return session
