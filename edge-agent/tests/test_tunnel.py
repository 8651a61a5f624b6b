"""The tunnel to a relay that Zenoh can't reach on its own: a real proxy, real TLS, the real agent."""

from __future__ import annotations

import json
import os
import shutil
import socket
import ssl
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import zenoh
from command_stage import run_edge
from edge_stage import ROBOT, Edge
from posecast_edge.uplink import tunnel as tunnels
from posecast_edge.uplink.credentials import Certificate, Proof
from posecast_edge.uplink.diagnosis import check_credential, check_steps, diagnose_link
from posecast_edge.uplink.route import RelayRoute, parse_proxy
from posecast_edge.uplink.tunnel import Tunnel
from posecast_testing import free_port, until
from posecast_testing.connect_proxy import ConnectProxy
from posecast_wire import Credential
from posecast_wire.keys import alive_key

pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl here")

NAME = "robots.lab.example"  # known to the proxy alone
LOGIN = "me:s3cret"
NEW = "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes"


@pytest.fixture(scope="module")
def secrets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An authority ca.pem, and certificates of it: relay.pem for NAME alone, and robot.pem."""
    folder = tmp_path_factory.mktemp("secrets")
    lines = [f"req -x509 {NEW} -days 2 -subj /CN=campus -keyout ca.key -out ca.pem"]
    for name, host in (("relay", NAME), ("robot", ROBOT)):
        (folder / f"{name}.names").write_text(f"subjectAltName=DNS:{host}\nbasicConstraints=CA:FALSE\n")
        signed = f"-CA ca.pem -CAkey ca.key -set_serial 2 -extfile {name}.names -out {name}.pem"
        lines += [
            f"req {NEW} -subj /CN={host} -keyout {name}.key -out {name}.csr",
            f"x509 -req -in {name}.csr -days 2 {signed}",
        ]
    for line in lines:
        subprocess.run(["openssl", *line.split()], cwd=folder, check=True, capture_output=True)
    for key in folder.glob("*.key"):
        key.chmod(0o600)
    return folder


class TlsRouter:
    """A Zenoh router with TLS on 127.0.0.1, which asks for certificates if it is given an authority."""

    def __init__(self, secrets: Path, authority: Path | None = None) -> None:
        self.port, self.tokens = free_port(), list[str]()
        tls = {
            "listen_certificate": str(secrets / "relay.pem"),
            "listen_private_key": str(secrets / "relay.key"),
        }
        if authority is not None:
            tls |= {"root_ca_certificate": str(authority), "enable_mtls": True}  # type: ignore[dict-item]
        config = {
            "mode": "router",
            "listen": {"endpoints": [f"tls/127.0.0.1:{self.port}"]},
            "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
            "transport": {"link": {"tls": tls}},
        }
        self.session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
        self._kept = [
            self.session.liveliness().declare_subscriber("posecast/v1/*/alive", self._on_token, history=True),
            self.session.declare_subscriber("posecast/v1/*/*/frame", lambda _: None),
        ]

    def _on_token(self, sample: zenoh.Sample) -> None:
        self.tokens.append(str(sample.key_expr))


@pytest.fixture
def router(secrets: Path) -> Iterator[TlsRouter]:
    made = TlsRouter(secrets)
    yield made
    made.session.close()  # type: ignore[no-untyped-call]


@pytest.fixture
def proxy(router: TlsRouter) -> Iterator[ConnectProxy]:
    made = ConnectProxy(login=LOGIN, lead={(NAME, 443): ("127.0.0.1", router.port)})
    yield made
    made.close()


@pytest.fixture
def start() -> Iterator[Callable[..., Edge]]:
    started: list[Edge] = []

    def start(*words: str) -> Edge:
        started.append(Edge("run", "--source", "demo", *words))
        return started[-1]

    yield start
    for each in started:
        each.kill()


def through(proxy: ConnectProxy) -> RelayRoute:
    return RelayRoute(f"tls/{NAME}:443", None, parse_proxy(proxy.url))


@pytest.fixture
def server(secrets: Path) -> Iterator[TlsServer]:
    made = TlsServer(secrets)
    yield made
    made.close()


class TlsServer:
    """Sends back what it gets. It has a certificate for NAME, and refuses TLS to other names with `alert` if
    that is set."""

    def __init__(self, secrets: Path) -> None:
        self.alert: int | None = None
        self.ended = threading.Event()
        self._context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self._context.load_cert_chain(secrets / "relay.pem", secrets / "relay.key")
        self._context.sni_callback = lambda _, name, __: None if name == NAME else self.alert
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address: tuple[str, int] = self._listener.getsockname()
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                threading.Thread(target=self._serve, args=(self._listener.accept()[0],), daemon=True).start()

    def _serve(self, plain: socket.socket) -> None:
        with suppress(OSError), self._context.wrap_socket(plain, server_side=True) as link:
            while data := link.recv(65536):
                link.sendall(data)
        self.ended.set()


@pytest.fixture
def make_tunnel() -> Iterator[Callable[[RelayRoute], Tunnel]]:
    made: list[Tunnel] = []

    def make(route: RelayRoute) -> Tunnel:
        made.append(Tunnel(route, lambda _: None))
        return made[-1]

    yield make
    for each in made:
        each.close()


def enter(tunnel: Tunnel, proof: Proof | None) -> socket.socket:
    """As Zenoh does."""
    end = socket.socket(socket.AF_UNIX)
    end.settimeout(60)
    end.connect(tunnel.open(proof).removeprefix("unixsock-stream/"))
    return end


def trusting(secrets: Path) -> Credential:
    return Credential(ROBOT, "x" * 43, (secrets / "ca.pem").read_text())


def own_certificate(secrets: Path) -> Certificate:
    return Certificate(secrets / "robot.pem", secrets / "robot.key", secrets / "ca.pem")


def own_flags(secrets: Path) -> tuple[str, ...]:
    proof = own_certificate(secrets)
    return "--robot", ROBOT, f"--tls-cert={proof.chain}", f"--tls-key={proof.key}", f"--tls-ca={proof.ca}"


def test_an_agent_goes_through_a_proxy_and_shows_its_certificate(
    secrets: Path, start: Callable[..., Edge], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    router = TlsRouter(secrets, secrets / "ca.pem")
    proxy = ConnectProxy(login=LOGIN, lead={(NAME, 443): ("127.0.0.1", router.port)})
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    try:
        edge = start("--relay", f"tls/{NAME}:443", "--proxy", proxy.url, *own_flags(secrets))
        until("on air", lambda: alive_key(ROBOT) in router.tokens, 60)
        assert proxy.requests[0] == f"CONNECT {NAME}:443 HTTP/1.1"
        (folder,) = tmp_path.iterdir()
        assert folder.stat().st_mode & 0o777 == 0o700
        edge.process.terminate()
        assert edge.wait(60) == 0
        assert not any("s3cret" in line for line in edge.lines), edge.lines
        assert not list(tmp_path.iterdir()), "the entrance is gone with the agent"
    finally:
        proxy.close()
        router.session.close()  # type: ignore[no-untyped-call]


def test_the_name_may_differ_from_the_address(
    secrets: Path, router: TlsRouter, start: Callable[..., Edge]
) -> None:
    to = ("--relay", f"tls/127.0.0.1:{router.port}")
    wrong = start(*to, "--relay-name", "other.example", *own_flags(secrets))
    mismatch = "hostname mismatch, certificate is not valid for 'other.example'"
    until("it says so", lambda: any(mismatch in line for line in wrong.lines), 60)
    assert not router.tokens
    start(*to, "--relay-name", NAME, *own_flags(secrets))
    until("on air", lambda: alive_key(ROBOT) in router.tokens, 60)


def test_every_byte_goes_both_ways_and_an_end_ends_both(
    secrets: Path, server: TlsServer, make_tunnel: Callable[[RelayRoute], Tunnel]
) -> None:
    tunnel = make_tunnel(RelayRoute(f"tls/127.0.0.1:{server.address[1]}", NAME))
    sent = os.urandom(3_000_000)
    with enter(tunnel, trusting(secrets)) as end:
        until("its buffer is small", lambda: is_small(end), 60)
        threading.Thread(target=end.sendall, args=(sent,), daemon=True).start()
        got = bytearray()
        while len(got) < len(sent):
            got += end.recv(65536)
        assert got == sent
    assert server.ended.wait(60)


def is_small(end: socket.socket) -> bool:
    return end.getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF) == 2 * tunnels.LOCAL_SNDBUF_BYTES


def test_only_this_process_may_enter(secrets: Path, server: TlsServer) -> None:
    proxy, warnings = ConnectProxy(lead={(NAME, 443): server.address}), list[str]()
    tunnel = Tunnel(through(proxy), warnings.append)
    try:
        path = tunnel.open(own_certificate(secrets)).removeprefix("unixsock-stream/")
        reads = "s.settimeout(30); s.connect(sys.argv[1]); print(s.recv(1))"
        stranger = f"import socket, sys; s = socket.socket(socket.AF_UNIX); {reads}"
        words = [sys.executable, "-c", stranger, path]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
            assert process.communicate(timeout=60)[0] == "b''\n"
        assert warnings == [f"process {process.pid} may not use this robot's connection to {through(proxy)}"]
        assert proxy.requests == []
    finally:
        tunnel.close()
        proxy.close()


def test_a_proxy_that_refuses_is_not_asked_again_at_once(
    secrets: Path, proxy: ConnectProxy, make_tunnel: Callable[[RelayRoute], Tunnel]
) -> None:
    wrong = proxy.url.replace("s3cret", "other")
    tunnel = make_tunnel(RelayRoute(f"tls/{NAME}:443", None, parse_proxy(wrong)))
    for _ in range(5):
        with enter(tunnel, None) as end:
            assert end.recv(1) == b""
    assert len(proxy.requests) == 1
    assert tunnel.refusal.endswith("refuses the user or password in its URL")


def test_entrances_are_shared_by_those_who_trust_the_same(
    secrets: Path, make_tunnel: Callable[[RelayRoute], Tunnel]
) -> None:
    tunnel = make_tunnel(RelayRoute("tls/127.0.0.1:1", NAME))
    one = tunnel.open(trusting(secrets))
    assert tunnel.open(Credential(ROBOT, "y" * 43, trusting(secrets).ca)) == one
    others = [tunnel.open(Credential(ROBOT, "x" * 43, ca)) for ca in "abcd"]
    assert len({one, *others}) == 5
    assert not Path(one.removeprefix("unixsock-stream/")).exists(), "the oldest is closed"
    assert len(list(Path(others[0].removeprefix("unixsock-stream/")).parent.iterdir())) == 4


@pytest.mark.parametrize(
    "alert", [ssl.ALERT_DESCRIPTION_UNRECOGNIZED_NAME, ssl.ALERT_DESCRIPTION_INTERNAL_ERROR]
)
def test_an_alert_is_proof_of_tls(secrets: Path, server: TlsServer, alert: int) -> None:
    server.alert = alert
    words = "unrecognized name" if alert == ssl.ALERT_DESCRIPTION_UNRECOGNIZED_NAME else "internal error"
    found = diagnose_link(RelayRoute(f"tls/127.0.0.1:{server.address[1]}"), trusting(secrets))
    assert found.why == (
        f"speaks TLS, but refuses connections to 127.0.0.1 ({words}): use its name instead of an address, or "
        "give the name with --relay-name"
    )
    found = diagnose_link(
        RelayRoute(f"tls/127.0.0.1:{server.address[1]}", "other.example"), trusting(secrets)
    )
    assert found.why.endswith(f"connections to other.example ({words}): use a name in its certificate")


def test_each_step_is_named(secrets: Path, router: TlsRouter, proxy: ConnectProxy) -> None:
    proof = own_certificate(secrets)

    def failing(route: RelayRoute, proof: Proof | None = proof) -> tuple[list[str], str]:
        """The steps, and what the last one found if it failed."""
        steps = list(check_steps(route, proof))
        assert not any(step.failed for step in steps[:-1])
        return [step.name for step in steps], steps[-1].text if steps[-1].failed else ""

    assert failing(through(proxy)) == (["name", "proxy", "TLS", "Zenoh"], "")
    at = f"tls/127.0.0.1:{router.port}"
    assert failing(RelayRoute(at, NAME)) == (["name", "TCP", "TLS", "Zenoh"], "")
    assert failing(RelayRoute("tls/no.such.invalid:1")) == (
        ["name"],
        "can't be reached: its name no.such.invalid is unknown here",
    )
    assert failing(RelayRoute(f"tls/127.0.0.1:{free_port()}")) == (["name", "TCP"], "does not answer")
    refused = RelayRoute(f"tls/{NAME}:7447", None, parse_proxy(proxy.url))
    steps, why = failing(refused)
    assert steps == ["name", "proxy"]
    assert why.endswith(f"does not allow connections to {NAME}:7447 (status 403)")
    steps, why = failing(through(proxy), None)
    assert steps == ["name", "proxy", "TLS"]
    assert f"issuer certificate. It is the certificate of {NAME}, issued by campus, valid until" in why
    assert why.endswith("Is it the proxy's? A proxy must not open this connection")

    accepts = check_credential(through(proxy), proof, ROBOT)
    assert (accepts.failed, accepts.text) == (False, f"accepts '{ROBOT}'")
    stranger = check_credential(RelayRoute(at, "other.example"), proof, ROBOT)
    assert stranger.failed
    assert "hostname mismatch" in stranger.text


def test_the_doctor_says_which_step_fails(secrets: Path, router: TlsRouter, proxy: ConnectProxy) -> None:
    words = ("doctor", "--relay", f"tls/{NAME}:443", *own_flags(secrets))
    good = run_edge(*words, env={**os.environ, "HTTPS_PROXY": proxy.url})
    assert (good.returncode, good.stderr) == (0, "")
    *steps, last = good.stdout.splitlines()
    assert [line.split()[0] for line in steps] == ["name", "proxy", "TLS", "Zenoh", "credential"]
    shown = f"tls/{NAME}:443 through the proxy 127.0.0.1:{proxy.address[1]}"
    assert last == f"{shown}: nothing wrong"

    bad = run_edge(*words, env={**os.environ, "HTTPS_PROXY": proxy.url.replace("s3cret", "0ther")})
    assert bad.returncode == 1
    assert bad.stdout.splitlines()[-2:] == [
        f"{shown}: error: can't be reached: the proxy 127.0.0.1:{proxy.address[1]} refuses the user or "
        "password in its URL [relay-proxy]",
        f"{shown}: 1 error",
    ]
    assert "s3cret" not in good.stdout
    assert "0ther" not in bad.stdout + bad.stderr
    wrong = run_edge(*words, "--proxy", f"ftp://{LOGIN}@x")
    assert wrong.returncode == 2
    assert "--proxy: 'ftp' proxies can't be used, only http:// ones" in wrong.stderr
    assert "s3cret" not in wrong.stderr
