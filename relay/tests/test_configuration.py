"""Files of the configuration that can't be taken: a relay never ends over one, and says so."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import httpx
import pytest
from posecast_relay.zenoh.router import CertificateError, RouterCertificates
from posecast_testing import Process, free_port, until
from posecast_wire import Credential

from .certificates import certificates
from .stage import START_S, Relay, ZenohEdge
from .test_publishers import Lab, is_let_in

WRONG = "[robots.secret-robot]\nsecrte = 1\n"
KEPT = "[robots.hubo]\nkeep = '1d'\n"
SECRET = "C" * 43


class Starting(Process):
    """A relay that may not have begun to serve, on a known port."""

    def __init__(self, folder: Path, robots: Path, *flags: str) -> None:
        port = free_port()
        self.url = f"http://127.0.0.1:{port}"
        command = (sys.executable, "-m", "posecast_relay.cli", "run", "--robots", str(robots))
        ports = ("--port", str(port), "--zenoh-listen", "tcp/127.0.0.1:0")
        super().__init__(folder, "relay", *command, *ports, *flags)

    def ask(self, path: str) -> httpx.Response | None:
        """Its answer; None while nobody listens."""
        try:
            return httpx.get(self.url + path)
        except httpx.TransportError:
            return None

    def is_ready(self, status: str) -> bool:
        """Whether `/readyz` says this word."""
        answer = self.ask("/readyz")
        return answer is not None and answer.json()["status"] == status


@pytest.fixture
def starting(tmp_path: Path) -> Iterator[Callable[..., Starting]]:
    """Relays that are started, and ended after the test."""
    started: list[Starting] = []

    def start(robots: Path, *flags: str) -> Starting:
        started.append(Starting(tmp_path, robots, *flags))
        return started[-1]

    yield start
    for each in started:
        each.kill()


def write(path: Path, text: str) -> Path:
    """The file of robots."""
    path.write_text(text)
    path.chmod(0o600)
    return path


def test_a_relay_waits_for_a_file_that_is_wrong_or_not_there(
    tmp_path: Path, starting: Callable[..., Starting]
) -> None:
    path = tmp_path / "robots.toml"
    relay = starting(path)
    until("it waits", partial(relay.is_ready, "waiting"), START_S)
    why = f"robots.toml: no such file or directory (`posecast-relay robots add --robots {path} ID` makes it)"
    until("it says why", lambda: f"{why}; nobody can publish" in relay.errors())
    write(path, WRONG)
    until("it says the next reason", lambda: "unknown field 'secrte'" in relay.errors())
    for route, status in (("/livez", 200), ("/readyz", 503), ("/api/v1/robots", 503), ("/", 503)):
        answer = relay.ask(route)
        assert answer is not None
        assert answer.status_code == status
        assert "secret-robot" not in answer.text, "whoever asks may not know that it is there"
    assert relay.errors().count("nobody can publish or watch until this is fixed") == 2
    assert relay.process.poll() is None

    write(path, "[robots.hubo.anyone]\n")
    until("it serves", partial(relay.is_ready, "ready"), START_S)
    assert relay.ask("/api/v1/robots/hubo") is not None

    write(path, KEPT)  # a running one goes on
    until("it is degraded", partial(relay.is_ready, "degraded"))
    lack = r"\[robots\.hubo\] keep: needs an object store.*its last good version stays"
    until("it says why", lambda: re.search(lack, relay.errors()) is not None)
    write(path, "[robots.hubo.anyone]\n")
    until("all is well", partial(relay.is_ready, "ready"))
    assert relay.stop() == 0


def test_a_relay_without_the_store_that_its_file_needs_ends(
    tmp_path: Path, starting: Callable[..., Starting]
) -> None:
    path = write(tmp_path / "robots.toml", KEPT)
    relay = starting(path)
    assert relay.process.wait(START_S) == 2
    (line,) = relay.errors().splitlines()
    assert f"{path}: [robots.hubo] keep: needs an object store: give the relay --past" in line


def test_while_it_waits_a_signal_ends_it(tmp_path: Path, starting: Callable[..., Starting]) -> None:
    relay = starting(tmp_path / "robots.toml")
    until("it waits", partial(relay.is_ready, "waiting"), START_S)
    assert relay.stop() == 0


def test_a_relay_waits_for_certificates_too(tmp_path: Path, starting: Callable[..., Starting]) -> None:
    path = write(tmp_path / "robots.toml", "# none\n")
    cert, key = tmp_path / "server.pem", tmp_path / "server.key"
    flags = ("--zenoh-tls-cert", str(cert), "--zenoh-tls-key", str(key))
    relay = starting(path, *flags, "--zenoh-listen", "tls/127.0.0.1:0")
    until(
        "it says why",
        lambda: f"--zenoh-tls-cert {cert}: no such file or directory" in relay.errors(),
        START_S,
    )
    assert relay.is_ready("waiting")
    certificates(tmp_path)
    until("it serves", partial(relay.is_ready, "ready"), START_S)


def test_a_certificate_that_is_none_is_one_line(tmp_path: Path) -> None:
    certificates(tmp_path)
    cert, key = tmp_path / "server.pem", tmp_path / "server.key"
    for pair in ((key, cert), (tmp_path / "names", key)):  # the wrong way round, and no certificate
        with pytest.raises(CertificateError) as error:
            RouterCertificates(*pair, None)
        said = f"--zenoh-tls-cert {pair[0]}, --zenoh-tls-key {pair[1]}: not a valid pair"
        assert str(error.value) == said
    with pytest.raises(CertificateError, match=r"--zenoh-ca .*: no certificate in PEM form"):
        RouterCertificates(None, None, tmp_path / "names")
    with pytest.raises(CertificateError, match=r"--zenoh-ca .*: is not a file"):
        RouterCertificates(None, None, tmp_path)
    assert len(RouterCertificates(cert, key, tmp_path / "ca.pem").make_settings()) == 3


def test_a_certificate_that_zenoh_can_not_use_is_none_either(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    certificates(tmp_path)
    cert, key = tmp_path / "server.pem", tmp_path / "server.key"
    found = RouterCertificates(cert, key, None)
    before = found.make_settings()
    words = "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-521 -nodes -days 2 -subj /CN=server"
    subprocess.run(["openssl", *words.split(), "-keyout", key, "-out", cert], check=True, capture_output=True)
    assert found.refresh() is False
    assert found.make_settings() == before
    said = f"--zenoh-tls-cert {cert}, --zenoh-tls-key {key}: Zenoh can't use them: "
    assert (found.trouble or "").startswith(said)
    assert caplog.messages == [f"{found.trouble}; the last good certificates stay in force"]
    certificates(tmp_path)
    assert found.refresh() is True
    assert found.trouble is None


@pytest.fixture
def lab(tmp_path: Path, relays: Callable[..., Relay]) -> Lab:
    """A relay with TLS and a file of robots."""
    return Lab(tmp_path, relays)


def explain(lab: Lab) -> dict[str, str]:
    """What `/readyz` says."""
    answer = httpx.get(f"http://{lab.relay.address}/readyz")
    assert answer.status_code == 200
    return dict(answer.json())


def test_a_running_relay_keeps_what_a_file_said_before(lab: Lab, edges: Callable[..., ZenohEdge]) -> None:
    credential = lab.credential("hubo")
    relay = lab.start()
    edge = edges(relay.zenoh, robot="hubo", credential=credential)
    state = f"http://{relay.address}/api/v1/robots/hubo/state"
    until("on air", lambda: httpx.get(state).status_code == 200)
    assert (explain(lab), lab.figure("posecast_config_up")) == ({"status": "ready"}, 2)
    good = lab.file.read_text()
    write(lab.file, WRONG)
    until("it is degraded", lambda: explain(lab)["status"] == "degraded")
    assert explain(lab)["why"] == (
        "the robots file can't be used, so its last good version stays in force; the log says why"
    )
    assert lab.figure("posecast_config_up") == 1
    seq = edge.seq
    until("the robot goes on", lambda: edge.seq > seq + 30 and httpx.get(state).json()["seq"] > seq)
    assert lab.told("unknown field 'secrte'.*its last good version stays in force")
    write(lab.file, good)
    until("all is well", lambda: explain(lab) == {"status": "ready"})
    assert lab.figure("posecast_config_up") == 2


def test_certificates_that_are_damaged_are_those_of_before_and_new_ones_are_taken(
    lab: Lab, edges: Callable[..., ZenohEdge]
) -> None:
    credential = lab.credential("hubo")
    relay = lab.start()
    edges(relay.zenoh, robot="hubo", credential=credential)
    cert = lab.folder / "server.pem"
    good = cert.read_bytes()
    cert.write_text("no certificate")
    until("it is degraded", lambda: explain(lab)["status"] == "degraded", 30.0)
    assert explain(lab)["why"].startswith("the certificates file can't be used, so its last good version")
    assert lab.told("not a valid pair; the last good certificates stay in force")
    other = lab.credential("other")  # for which the session is opened anew
    until("it is enrolled", lambda: lab.told("publishers enrolled: other"))
    edges(relay.zenoh, robot="other", credential=other)
    robots = f"http://{relay.address}/api/v1/robots"
    until("it is let in", lambda: httpx.get(f"{robots}/other/state").status_code == 200)
    cert.write_bytes(good)
    until("all is well", lambda: explain(lab) == {"status": "ready"}, 30.0)

    (lab.folder / "old.pem").write_bytes((lab.folder / "ca.pem").read_bytes())
    certificates(lab.folder)  # of another authority
    until("they are taken", lambda: lab.told("using the renewed certificates"), 30.0)
    ca = (lab.folder / "ca.pem").read_text()
    newer = Credential("other", other.secret, ca)
    until("by the new ones it is let in", partial(is_let_in, lab, newer), 30.0)


def test_a_change_for_which_there_is_no_room_comes_later_and_the_robots_of_before_go_on(
    lab: Lab, edges: Callable[..., ZenohEdge], monkeypatch: pytest.MonkeyPatch
) -> None:
    room = lab.folder / "tmp"
    room.mkdir()
    credential = lab.credential("hubo")
    monkeypatch.setenv("TMPDIR", str(room))
    relay = lab.start()
    monkeypatch.undo()
    edge = edges(relay.zenoh, robot="hubo", credential=credential)
    robots = f"http://{relay.address}/api/v1/robots"
    until("on air", lambda: httpx.get(f"{robots}/hubo/state").status_code == 200)
    links = relay.errors().count("robot hubo on air")
    room.rmdir()
    other = lab.credential("other")
    until("it is degraded", lambda: explain(lab)["status"] == "degraded")
    assert explain(lab)["why"] == (
        "a change of the robots or certificates is not in force; retrying; the log says why"
    )
    assert lab.told(f"its last change is not in force: {room}: no such file or directory; retrying")
    assert (lab.figure("posecast_config_up"), lab.figure("posecast_robots_port_up")) == (1, 1)
    assert not is_let_in(lab, other)
    seq = edge.seq
    until(
        "the robot goes on",
        lambda: edge.seq > seq + 30 and httpx.get(f"{robots}/hubo/state").json()["seq"] > seq,
    )
    assert relay.errors().count("robot hubo on air") == links
    room.mkdir()
    until("all is well", lambda: explain(lab) == {"status": "ready"})
    assert lab.told("robots.toml: its last change is in force")
    assert lab.told("publishers enrolled: other")
    assert is_let_in(lab, other)
    assert lab.figure("posecast_config_up") == 2


def test_a_port_that_is_taken_is_opened_when_it_is_free_again(
    lab: Lab, edges: Callable[..., ZenohEdge], monkeypatch: pytest.MonkeyPatch
) -> None:
    taken, port = lab.folder / "taken", free_port()
    taken.touch()
    monkeypatch.setenv("TAKEN", str(taken))
    monkeypatch.setenv("TAKEN_PORT", str(port))
    credential = lab.credential("hubo")
    relay = lab.start(zenoh_port=port, module="relay.tests.taken_port")
    edges(relay.zenoh, robot="hubo", credential=credential)

    def status() -> str:
        found = httpx.get(f"http://{relay.address}/api/v1/robots").json()["robots"]
        return next((str(each["status"]) for each in found), "")

    until("on air", lambda: status() == "online")
    lab.credential("other")
    until("it is degraded", lambda: explain(lab)["status"] == "degraded")
    assert explain(lab)["why"] == (
        "robots can't connect, because their port can't be opened; retrying; the log says why"
    )
    until(
        "the log says why", lambda: lab.told(f"robots can't connect: zenoh listener {relay.zenoh}: address")
    )
    assert (lab.figure("posecast_config_up"), lab.figure("posecast_robots_port_up")) == (2, 0), "one alarm"
    until("viewers see that it is gone", lambda: status() == "offline")
    taken.unlink()
    until("all is well", lambda: explain(lab) == {"status": "ready"}, 30.0)
    assert lab.told("publishers enrolled: other")
    assert (lab.figure("posecast_config_up"), lab.figure("posecast_robots_port_up")) == (2, 1)
    until("the robot is back", lambda: status() == "online")
