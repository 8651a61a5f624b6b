"""Why there is no link, found out by other means than Zenoh's."""

from __future__ import annotations

import json
import shutil
import socket
import ssl
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import zenoh
from edge_stage import ROBOT, Edge, Router
from posecast_edge.uplink import diagnosis as doorbell
from posecast_edge.uplink.credentials import Certificate
from posecast_edge.uplink.diagnosis import Diagnosis, RefusalPatience, diagnose_link
from posecast_edge.uplink.route import RelayRoute
from posecast_testing import free_port, until
from posecast_wire import Credential
from posecast_wire.keys import alive_key

needs_openssl = pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl here")


def make_certificate(folder: Path, name: str) -> None:
    """NAME.pem and NAME.key, signed by itself."""
    new = "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes"
    names = "-addext subjectAltName=IP:127.0.0.1"
    made = f"req -x509 {new} {names} -days 2 -subj /CN={name} -keyout {name}.key -out {name}.pem"
    subprocess.run(["openssl", *made.split()], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    """Takes connections and says nothing."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def test_nobody_there() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    assert diagnose_link(RelayRoute(f"tcp/127.0.0.1:{port}"), None) == Diagnosis("does not answer")
    nameless = "can't be reached: its name no.such.host.invalid is unknown here"
    assert diagnose_link(RelayRoute("tcp/no.such.host.invalid:1"), None) == Diagnosis(nameless)


@pytest.mark.parametrize("proof", [None, Credential("hubo", "x" * 43)])
def test_somebody_who_hangs(
    listener: socket.socket, proof: Credential | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doorbell, "PATIENCE_S", 0.1)
    says = diagnose_link(RelayRoute(f"tcp/127.0.0.1:{listener.getsockname()[1]}"), proof).why
    assert says == "accepts connections but sends nothing: does it hang, or is it still starting?"


def test_somebody_who_does_not_let_it_in(router: Router, tmp_path: Path) -> None:
    router.stop()
    passwords = tmp_path / "passwords"
    passwords.write_text(f"g1:{'y' * 43}\n")
    config = {
        "mode": "router",
        "listen": {"endpoints": [router.endpoint]},
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"auth": {"usrpwd": {"dictionary_file": str(passwords)}}},
    }
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))):
        nothing = diagnose_link(RelayRoute(router.endpoint), None)
        assert nothing.why.endswith("does it need a credential (--credential, in Python credential=)?")
        wrong = diagnose_link(RelayRoute(router.endpoint), Credential("hubo", "x" * 43))
        assert wrong.why == "refuses 'hubo': its credential is wrong, expired or revoked"
        assert nothing.is_refusal
        assert wrong.is_refusal


def test_a_good_credential_for_a_relay_that_takes_anybody(router: Router) -> None:
    found = diagnose_link(RelayRoute(router.endpoint), Credential("hubo", "x" * 43))
    assert found.why.startswith("accepts robots without a credential, like a relay with --dev: remove")
    assert not found.is_refusal


def test_only_who_refuses_again_and_again_is_said_to() -> None:
    refusal, away = Diagnosis("does not let it in", True), Diagnosis("does not answer")
    patience = RefusalPatience()
    assert patience.is_sure(away, 0.0)
    assert [patience.is_sure(refusal, at) for at in (1.0, 3.0, 5.9, 6.0)] == [False, False, False, True]
    patience = RefusalPatience()
    assert [patience.is_sure(refusal, at) for at in (0.0, 9.0, 9.1)] == [False, False, True]
    patience.is_sure(away, 10.0)
    assert not patience.is_sure(refusal, 20.0), "it was away in between"


def test_a_relay_that_is_slow_at_first_is_not_said_to_refuse(
    router: Router, edge: Callable[..., Edge], profile_file: Path
) -> None:
    """It takes the agent's first tries, and makes no link of them."""
    router.stop()
    knocked = threading.Event()
    with socket.create_server((router.host, router.port)) as slow:
        slow.settimeout(20)
        running = edge("--profile", str(profile_file))
        until_s = time.monotonic() + 20.0
        while not knocked.is_set() and time.monotonic() < until_s:
            with slow.accept()[0] as link:
                if link.recv(2) == doorbell.PROBE:  # the agent asks why there is no link
                    knocked.set()
        assert knocked.is_set()
    router.start()
    until("on air", lambda: router.tokens[-1:] == [(alive_key(ROBOT), True)], 30.0)
    assert not [line for line in running.lines if "does it need a credential" in line]


def test_no_tls_where_it_is_asked_for(listener: socket.socket) -> None:
    listener.settimeout(5)
    address = f"tls/127.0.0.1:{listener.getsockname()[1]}"

    def answer() -> None:
        with listener.accept()[0] as link:
            link.recv(4096)
            link.sendall(b"\x02\x00\x03\x02")  # as Zenoh does

    def answer_twice() -> None:
        answer()
        answer()

    thread = threading.Thread(target=answer_twice)
    thread.start()
    assert diagnose_link(RelayRoute(address), None).why == "does not speak TLS: is it a tcp/… endpoint?"
    thread.join()


NGINX = """
daemon off; master_process off; pid {folder}/pid; error_log stderr; events {{}}
http {{
    access_log off;
    client_body_temp_path {folder}/a; proxy_temp_path {folder}/b; fastcgi_temp_path {folder}/c;
    uwsgi_temp_path {folder}/d; scgi_temp_path {folder}/e;
    server {{ listen 127.0.0.1:{port}; return 200 page; }}
    server {{
        listen 127.0.0.1:{tls_port} ssl; return 200 page;
        ssl_certificate {folder}/relay.pem; ssl_certificate_key {folder}/relay.key;
    }}
}}
"""


@needs_openssl
@pytest.mark.skipif(shutil.which("nginx") is None, reason="no nginx here")
def test_the_port_of_a_web_page(tmp_path: Path) -> None:
    make_certificate(tmp_path, "relay")
    port, tls_port = free_port(), free_port()
    (tmp_path / "conf").write_text(NGINX.format(folder=tmp_path, port=port, tls_port=tls_port))
    proof = Credential("hubo", "x" * 43, (tmp_path / "relay.pem").read_text())
    server = subprocess.Popen(["nginx", "-p", tmp_path, "-c", tmp_path / "conf"], stderr=subprocess.DEVNULL)
    try:
        until("nginx listens", lambda: listens(port) and listens(tls_port))
        for endpoint in (f"tcp/127.0.0.1:{port}", f"tls/127.0.0.1:{port}", f"tls/127.0.0.1:{tls_port}"):
            found = diagnose_link(RelayRoute(endpoint), proof)
            assert found == Diagnosis(doorbell.WEB), endpoint
            assert not found.is_refusal, "it is told at once"
    finally:
        server.terminate()
        server.wait(20)


@needs_openssl
def test_a_relay_that_wants_tls(tmp_path: Path) -> None:
    make_certificate(tmp_path, "relay")
    port = free_port()
    config = {
        "mode": "router",
        "listen": {"endpoints": [f"tls/127.0.0.1:{port}"]},
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {
            "link": {
                "tls": {
                    "listen_certificate": str(tmp_path / "relay.pem"),
                    "listen_private_key": str(tmp_path / "relay.key"),
                }
            }
        },
    }
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))):
        found = diagnose_link(RelayRoute(f"tcp/127.0.0.1:{port}"), Credential("hubo", "x" * 43))
    assert found == Diagnosis(f"requires TLS: use tls/127.0.0.1:{port}")


def listens(port: int) -> bool:
    with suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
        return True
    return False


@needs_openssl
def test_what_a_relay_that_wants_certificates_has_against_ours(tmp_path: Path) -> None:
    for name in ("relay", "robot"):  # each its own authority: the relay trusts its own alone
        make_certificate(tmp_path, name)
    relay_pem, relay_key = tmp_path / "relay.pem", tmp_path / "relay.key"
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(relay_pem, relay_key)
    context.verify_mode = ssl.CERT_REQUIRED
    context.load_verify_locations(relay_pem)
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(20)

        def asked(proof: Credential | Certificate) -> str:
            thread = threading.Thread(target=answer)
            thread.start()
            says = diagnose_link(RelayRoute(f"tls/127.0.0.1:{server.getsockname()[1]}"), proof).why
            thread.join()
            return says

        def answer() -> None:
            with server.accept()[0] as link, suppress(OSError), context.wrap_socket(link, server_side=True):
                pass

        ca = relay_pem.read_text()
        wants = "requires a certificate from this robot: give --tls-cert and --tls-key"
        assert asked(Credential("hubo", "x" * 43, ca)) == wants
        ours = Certificate(tmp_path / "robot.pem", tmp_path / "robot.key", relay_pem)
        assert asked(ours) == "refuses this robot's certificate: unknown ca"
        good = Certificate(relay_pem, relay_key, relay_pem)
        assert asked(good).endswith("(--credential, in Python credential=) instead of a certificate?")
