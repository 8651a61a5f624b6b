"""Files of the configuration that can't be taken: a relay never ends over one, and says so."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import httpx
import pytest
import zenoh
from posecast_relay.zenoh.certificates import CertificateError, RouterCertificates
from posecast_wire import Credential

from .certificates import certificates
from .stage import Relay, ZenohEdge, client_config, free_port, until
from .test_publishers import Lab

WRONG = "[robots.secret-robot]\nsecrte = 1\n"
SECRET = "C" * 43


class Starting:
    """A relay that may not have begun to serve, on a known port."""

    def __init__(self, folder: Path, robots: Path, *flags: str) -> None:
        self._errors = folder / "relay.err"
        self.url = f"http://127.0.0.1:{free_port()}"
        command = [sys.executable, "-m", "posecast_relay.cli", "run", "--robots", str(robots)]
        port = self.url.rpartition(":")[2]
        with self._errors.open("wb") as errors:
            self.process = subprocess.Popen(
                [*command, "--port", port, "--zenoh-listen", "tcp/127.0.0.1:0", *flags],
                stdout=subprocess.DEVNULL,
                stderr=errors,
            )

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

    def errors(self) -> str:
        """Its stderr."""
        return self._errors.read_text()

    def end(self) -> int:
        """By SIGTERM."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(15)


@pytest.fixture
def starting(tmp_path: Path) -> Iterator[Callable[..., Starting]]:
    """Relays that are started, and ended after the test."""
    started: list[Starting] = []

    def start(robots: Path, *flags: str) -> Starting:
        started.append(Starting(tmp_path, robots, *flags))
        return started[-1]

    yield start
    for each in started:
        each.process.kill()
        each.process.wait()


def write(path: Path, text: str) -> Path:
    """The file of robots."""
    path.write_text(text)
    path.chmod(0o600)
    return path


@pytest.mark.parametrize("workers", [1, 2])
def test_a_relay_waits_for_a_file_that_is_wrong_or_not_there(
    tmp_path: Path, starting: Callable[..., Starting], workers: int
) -> None:
    path = tmp_path / "robots.toml"
    relay = starting(path, "--workers", str(workers))
    until("it waits", partial(relay.is_ready, "waiting"))
    until(
        "it says why", lambda: "robots.toml: no such file or directory; nobody can publish" in relay.errors()
    )
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
    until("it serves", partial(relay.is_ready, "ready"))
    assert relay.ask("/api/v1/robots/hubo") is not None
    assert relay.end() == 0


def test_while_it_waits_a_signal_ends_it(tmp_path: Path, starting: Callable[..., Starting]) -> None:
    relay = starting(tmp_path / "robots.toml")
    until("it waits", partial(relay.is_ready, "waiting"))
    assert relay.end() == 0


def test_a_relay_waits_for_certificates_too(tmp_path: Path, starting: Callable[..., Starting]) -> None:
    path = write(tmp_path / "robots.toml", "# none\n")
    cert, key = tmp_path / "server.pem", tmp_path / "server.key"
    flags = ("--zenoh-tls-cert", str(cert), "--zenoh-tls-key", str(key))
    relay = starting(path, *flags, "--zenoh-listen", "tls/127.0.0.1:0")
    until("it says why", lambda: f"--zenoh-tls-cert {cert}: no such file or directory" in relay.errors())
    assert relay.is_ready("waiting")
    certificates(tmp_path)
    until("it serves", partial(relay.is_ready, "ready"))


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


def is_let_in(lab: Lab, credential: Credential) -> bool:
    """Whether a session can be opened with it."""

    try:
        with zenoh.open(client_config(lab.relay.zenoh, credential)):
            return True
    except zenoh.ZError:
        return False


def test_a_worker_that_is_started_anew_waits_for_the_file(
    tmp_path: Path, starting: Callable[..., Starting]
) -> None:
    path = write(tmp_path / "robots.toml", "[robots.hubo.anyone]\n")
    relay = starting(path, "--workers", "2")
    until("it serves", partial(relay.is_ready, "ready"))
    children = Path(f"/proc/{relay.process.pid}/task/{relay.process.pid}/children")
    (before,) = children.read_text().split()
    write(path, WRONG)
    until("it is degraded", partial(relay.is_ready, "degraded"))
    subprocess.run(["kill", "-9", before], check=True)
    until("it waits", lambda: "nobody can publish or watch until this is fixed" in relay.errors())
    (after,) = children.read_text().split()
    assert after != before
    write(path, "[robots.hubo.anyone]\n")
    until("both serve", partial(relay.is_ready, "ready"))
    assert children.read_text().split() == [after], "it did not end over the file"
    assert relay.end() == 0
