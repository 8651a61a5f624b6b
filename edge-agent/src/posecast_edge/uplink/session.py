"""The agent's Zenoh session: the run that stamps its messages, its settings, and the change to a session with
a new credential while the agent runs."""

from __future__ import annotations

import base64
import json
import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable

import zenoh
from posecast_wire.keys import Stamp, model_key

from posecast_edge import kit
from posecast_edge.kit import ExceptionLog, TokenBucket, make_visible
from posecast_edge.model.serve.bundle import RANGE_MAX, Bundle
from posecast_edge.uplink.credentials import Certificate, Proof, ProofWatcher

log = logging.getLogger("posecast_edge.link")


class Run:
    """One run of the agent, with a random id. Ids have no order: a robot's clock may start in 1970, and two
    agents may use the same robot's name."""

    def __init__(self) -> None:
        self.id = int.from_bytes(os.urandom(8), "big") or 1
        self._start_ns = kit.now_ns()

    def make_stamp(self, at_s: float | None = None) -> Stamp:
        """The attachment for data that became valid at `at_s` (seconds of kit.now_s(); None: now)."""
        at_ns = kit.now_ns() if at_s is None else round(at_s * 1e9)
        return Stamp(self.id, max(0, at_ns - self._start_ns))


OPEN_MS = 2000  # one attempt; between attempts the thread checks whether to stop
TUNNEL_OPEN_MS = 6000  # through a tunnel, where a proxy may have to check a login
TUNNEL = "unixsock-stream/"
LEASE_MS = 2500  # after this long without a sign of life, the relay considers the agent gone
# first and longest; quick at first: a relay that adds a robot reopens within milliseconds
RETRY_MS = (25, 1000)
BATCH_BYTES = 8192  # small batches and a small kernel buffer: on a slow uplink a queue only adds delay
SNDBUF_BYTES = 32768
HEARD_BYTES_MAX = 1 << 18  # per message to the agent, which receives only queries and echoes


def make_zenoh_config(relay: str, credential: Proof | None = None, tries_once: bool = False) -> zenoh.Config:
    """A Zenoh client that connects only to this relay and discovers nobody else. `relay`: an endpoint,
    `tcp/host:port`, or that of a tunnel. `tries_once`: try to connect once, instead of repeatedly for
    OPEN_MS."""
    link: dict[str, object] = {
        "tx": {"lease": LEASE_MS, "keep_alive": 4, "batch_size": BATCH_BYTES},
        "rx": {"max_message_size": HEARD_BYTES_MAX},
    }
    auth: dict[str, object] = {}
    if isinstance(credential, Certificate):
        own = {"connect_certificate": str(credential.chain), "connect_private_key": str(credential.key)}
        ca_file = {} if credential.ca is None else {"root_ca_certificate": str(credential.ca)}
        link["tls"] = {"enable_mtls": True, **own, **ca_file}
    elif credential is not None:
        auth["usrpwd"] = {"user": credential.robot, "password": credential.secret}
        if credential.ca is not None:  # otherwise the public authorities
            ca = base64.b64encode(credential.ca.encode()).decode()
            link["tls"] = {"root_ca_certificate_base64": ca}
    endpoint = relay if relay.startswith(("quic/", TUNNEL)) else f"{relay}#so_sndbuf={SNDBUF_BYTES}"
    open_ms = TUNNEL_OPEN_MS if relay.startswith(TUNNEL) else OPEN_MS
    first_ms = open_ms if tries_once else RETRY_MS[0]
    retry = {"period_init_ms": first_ms, "period_max_ms": RETRY_MS[1], "period_increase_factor": 2}
    return zenoh.Config.from_json5(
        json.dumps(
            {
                "mode": "client",
                "connect": {"endpoints": [endpoint], "timeout_ms": open_ms, "retry": retry},
                "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
                "transport": {"link": link, "auth": auth, "shared_memory": {"enabled": False}},
            }
        )
    )


LISTENER_S = 2.0  # with a wrong name in a valid certificate, the link opens but the relay does not listen
POLL_S = 0.01


def is_heard(session: zenoh.Session, key: str, gives_up: Callable[[], bool] = lambda: False) -> bool:
    """Whether the relay listens to messages with this key, or starts to within LISTENER_S."""
    probe = session.declare_publisher(key)
    until_s = time.monotonic() + LISTENER_S
    while not probe.matching_status.matching:  # type: ignore[attr-defined]
        if gives_up() or time.monotonic() > until_s:
            return False
        time.sleep(POLL_S)
    return True


# --- a new credential, while the agent runs: a second session, which takes over once the relay listens to it

LOOK_S = 1.0
AGAIN_S = 60.0  # the relay counts and may log each failed attempt


class ProofRotation:
    """Watches the files of `proof` in a separate thread. Its methods return at once."""

    def __init__(
        self,
        endpoint_for: Callable[[Proof | None], str],
        proof: Proof | None,
        key: str,
        is_linked: Callable[[], bool],
        opened: Callable[[], None],
        exceptions: ExceptionLog,
    ) -> None:
        """`endpoint_for`: where Zenoh reaches the relay with a credential; `key`: the relay listens on it to
        robots that it accepts; `is_linked`: whether the link with the old credential is up; `opened` is
        called when a session is ready to `take`."""
        self._endpoint_for, self._key = endpoint_for, key
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
            session = zenoh.open(make_zenoh_config(self._endpoint_for(proof), proof, tries_once))
        except zenoh.ZError:
            return None
        if is_heard(session, self._key, lambda: self._stopping):
            return session
        session.close()  # type: ignore[no-untyped-call]
        return None


# --- queries about the model

WAITING_MAX = 64  # questions; a relay asks for a few at a time
BYTES_S = 16e6  # the rate for repeated requests;
BYTES_AT_ONCE = 64e6  # a whole model up to this size is sent at full speed


class ModelServer:
    """Answers the model queries of one robot, one at a time in a separate thread, so that many queries or a
    slow uplink delay neither Zenoh's threads nor the frames. `bundle`: the model it has now."""

    def __init__(self, robot: str, run: Run, exceptions: ExceptionLog) -> None:
        self.bundle: Bundle | None = None
        self._robot, self._run, self._exceptions = robot, run, exceptions
        self._waiting: deque[zenoh.Query] = deque()
        self._bucket = TokenBucket(BYTES_S, BYTES_AT_ONCE)
        self._some = threading.Condition()
        self._begun = self._closed = False

    def close(self) -> None:
        """Stop answering. May be called from any thread; returns at once."""
        with self._some:
            self._closed = True
            self._some.notify()

    def enqueue_query(self, query: zenoh.Query) -> None:
        """Queue a query, or refuse it when WAITING_MAX are waiting already. Called by Zenoh's threads;
        returns at once."""
        with self._some:
            if not self._begun:
                self._begun = True
                threading.Thread(target=self._answer_all, name="model", daemon=True).start()
            if len(self._waiting) < WAITING_MAX:
                self._waiting.append(query)
                self._some.notify()
                return
        with query:
            query.reply_err(b"too many questions at a time")

    def _answer_all(self) -> None:
        while True:
            with self._some:
                self._some.wait_for(lambda: self._waiting or self._closed)
                if self._closed:
                    return
                wait_s = self._bucket.compute_wait_s(time.monotonic(), RANGE_MAX)
                if wait_s > 0:
                    self._some.wait_for(lambda: self._closed, wait_s)
                    continue
                query = self._waiting.popleft()
            try:
                self._answer(query)
            except Exception as e:
                self._exceptions.add("answering a query about the model", e)

    def _answer(self, query: zenoh.Query) -> None:
        part = str(query.key_expr).rpartition("/")[2]
        with query:
            try:
                data = self._range(part, query.parameters)
            except (KeyError, ValueError, OSError) as e:
                query.reply_err(make_visible(f"{part[:64]}: {e}", 200).encode())
                return
            self._bucket.take(time.monotonic(), len(data))
            query.reply(model_key(self._robot, part), data, attachment=self._run.make_stamp().pack())

    def _range(self, part: str, parameters: zenoh.Parameters) -> bytes:
        """The requested bytes. Raises KeyError, ValueError or OSError when there is no such file or range."""
        if self.bundle is None:
            raise KeyError("no model")
        offset = int(parameters.get("off") or 0)
        length = int(parameters.get("len") or RANGE_MAX)
        return self.bundle.read(part, offset, length)
