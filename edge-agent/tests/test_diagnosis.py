"""Why there is no link, found out by other means than Zenoh's."""

from __future__ import annotations

import shutil
import socket
import ssl
import subprocess
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from edge_stage import Router
from posecast_edge.uplink import diagnosis as doorbell
from posecast_edge.uplink.certificate import Certificate
from posecast_edge.uplink.diagnosis import diagnose_link
from posecast_wire import Credential


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    """Takes connections and says nothing."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def test_nobody_there() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    assert diagnose_link(f"tcp/127.0.0.1:{port}", None) == "does not answer"
    assert diagnose_link("tcp/no.such.host.invalid:1", None) == "does not answer"


@pytest.mark.parametrize("proof", [None, Credential("hubo", "x" * 43)])
def test_somebody_who_hangs(
    listener: socket.socket, proof: Credential | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doorbell, "PATIENCE_S", 0.1)
    says = diagnose_link(f"tcp/127.0.0.1:{listener.getsockname()[1]}", proof)
    assert says == "takes connections and says nothing: does it hang, or is it just starting?"


def test_somebody_who_does_not_let_it_in(router: Router) -> None:
    assert "does it want a --credential?" in diagnose_link(router.endpoint, None)
    says = diagnose_link(router.endpoint, Credential("hubo", "x" * 43))
    assert says == "does not let 'hubo' in: its credential is wrong, expired or revoked"


def test_no_tls_where_it_is_asked_for(listener: socket.socket) -> None:
    listener.settimeout(5)
    address = f"tls/127.0.0.1:{listener.getsockname()[1]}"

    def answer() -> None:
        with listener.accept()[0] as link:
            link.recv(1)
            link.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")

    thread = threading.Thread(target=answer)
    thread.start()
    assert diagnose_link(address, None) == "does not speak TLS: is it a tcp/… endpoint?"
    thread.join()


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl here")
def test_what_a_relay_that_wants_certificates_has_against_ours(tmp_path: Path) -> None:
    new = "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes"
    for name in ("relay", "robot"):  # each its own authority: the relay trusts its own alone
        names = "-addext subjectAltName=IP:127.0.0.1"
        made = f"req -x509 {new} {names} -days 2 -subj /CN={name} -keyout {name}.key -out {name}.pem"
        subprocess.run(["openssl", *made.split()], cwd=tmp_path, check=True, capture_output=True)
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
            says = diagnose_link(f"tls/127.0.0.1:{server.getsockname()[1]}", proof)
            thread.join()
            return says

        def answer() -> None:
            with server.accept()[0] as link, suppress(OSError), context.wrap_socket(link, server_side=True):
                pass

        ca = relay_pem.read_text()
        wants = "wants a certificate of this robot: give --tls-cert and --tls-key"
        assert asked(Credential("hubo", "x" * 43, ca)) == wants
        ours = Certificate(tmp_path / "robot.pem", tmp_path / "robot.key", relay_pem)
        assert asked(ours) == "does not take this robot's certificate: unknown ca"
        good = Certificate(relay_pem, relay_key, relay_pem)
        assert "does it want a --credential, not a certificate?" in asked(good)
