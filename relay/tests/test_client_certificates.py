"""Publishers with certificates (mutual TLS): real Zenoh, real certificates, the real agent.

The certificates are made by the very lines that docs/how-to/operate/use-certificates.md shows.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import httpx
import pytest
import zenoh
from posecast_testing import until
from posecast_wire import alive_key, echo_key, event_key, frame_key, snapshot_key
from posecast_wire.keys import Stamp

from .certificates import certificates
from .command import run_command
from .stage import Relay, client_config

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to/operate/use-certificates.md"
SHOWN = re.search(r"## Create an authority.*?```sh\n(.*?)```", PAGE.read_text(), re.DOTALL)
EVENT = {"type": "event", "t": 1.0, "level": "fault", "source": "x", "text": "x", "state": "on"}


class Lab:
    """An authority for robots, one for the relay, and the relay's file."""

    def __init__(self, folder: Path, relays: Callable[..., Relay]) -> None:
        self.server, self.folder = folder / "server", folder / "robots"
        for each in (self.server, self.folder):
            each.mkdir()
        certificates(self.server)
        self.file = folder / "robots.toml"
        self._relays = relays
        self._tries = 0

    def certificate(self, robot: str, days: int = 90, authority: str = "ours") -> tuple[Path, Path]:
        """Certificate and key, as the page says they are made; each authority is made once."""
        assert SHOWN is not None
        self._tries += 1
        folder = self.folder / authority
        folder.mkdir(exist_ok=True)
        authority_line, *lines = (line for line in SHOWN[1].splitlines() if not line.startswith("#"))
        name = f"{robot}-{self._tries}"
        script = "\n".join(lines).replace("hubo.", f"{name}.").replace("CN=hubo", f"CN={robot}")
        script = script.replace("-days 90", f"-days {days}")
        if not (folder / "ca.pem").exists():
            script = f"{authority_line}\n{script}"
        subprocess.run(["sh", "-ec", script], cwd=folder, check=True, capture_output=True, timeout=30)
        return folder / f"{name}.pem", folder / f"{name}.key"

    def robots(self, *words: str) -> None:
        """`posecast-relay robots …`."""
        assert run_command("robots", *words, "--robots", str(self.file)).returncode == 0

    def start(self) -> Relay:
        """With its metrics on a port of their own."""
        return self._relays(
            *("--robots", str(self.file), "--metrics-port", "0", "--log-level", "info"),
            *("--zenoh-tls-cert", str(self.server / "server.pem")),
            *("--zenoh-tls-key", str(self.server / "server.key")),
            *("--zenoh-ca", str(self.folder / "ours" / "ca.pem")),
            dev=False,
        )

    def open(self, relay: Relay, proof: tuple[Path, Path] | None, patience_ms: int = 5000) -> zenoh.Session:
        """A session as an edge has it, with nothing declared. ZError."""
        config = client_config(relay.zenoh)
        tls = {"root_ca_certificate": str(self.server / "ca.pem")}
        if proof is not None:
            own = {"connect_certificate": str(proof[0]), "connect_private_key": str(proof[1])}
            tls |= own
            config.insert_json5("transport/link/tls/enable_mtls", "true")
        for key, value in tls.items():
            config.insert_json5(f"transport/link/tls/{key}", json.dumps(value))
        config.insert_json5("connect/timeout_ms", str(patience_ms))
        return zenoh.open(config)

    def agent(
        self, relay: Relay, robot: str, proof: tuple[Path, Path] | None, out: Path, zenoh: str = ""
    ) -> subprocess.Popen[bytes]:
        """`posecast-edge` with the demo robot, linked to the relay or to `zenoh` in front of it; its stderr
        goes to `out`."""
        trust = ("--tls-ca", str(self.server / "ca.pem"))
        own = () if proof is None else ("--tls-cert", str(proof[0]), "--tls-key", str(proof[1]), *trust)
        edge = str(Path(sys.executable).parent / "posecast-edge")
        command = [edge, "run", "--robot", robot, "--source", "demo"]
        with out.open("wb") as errors:
            return subprocess.Popen([*command, "--relay", zenoh or relay.zenoh, *own], stderr=errors)


@pytest.fixture
def lab(tmp_path: Path, relays: Callable[..., Relay]) -> Lab:
    """Not started."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl here")
    return Lab(tmp_path, relays)


def told(file: Path, words: str) -> bool:
    return words in file.read_text()


def asked(session: zenoh.Session, selector: str) -> list[str]:
    return [str(r.ok.key_expr) for r in session.get(selector, timeout=1.0) if r.ok is not None]


def test_a_certificate_writes_its_own_robots_keys_and_no_others(lab: Lab) -> None:
    mine, _ = lab.certificate("mine"), lab.certificate("other")
    unknown = lab.certificate("unknown")
    for robot in ("mine", "other"):
        lab.robots("add", robot, "--certificate")
    assert "secret" not in lab.file.read_text()
    relay = lab.start()
    url = f"http://{relay.address}/api/v1/robots"
    stamp = Stamp(run_id=7, elapsed_ns=1).pack()
    heard: list[str] = []

    with lab.open(relay, mine) as ear, lab.open(relay, mine) as session, lab.open(relay, unknown) as stranger:
        keep: list[object] = [
            ear.declare_subscriber("**", lambda sample: heard.append(str(sample.key_expr))),
            ear.declare_queryable(snapshot_key("other", "public"), lambda q: heard.append(str(q.key_expr))),
        ]
        for each, names in ((stranger, ("mine", "other", "unknown")), (session, ("other", "unknown"))):
            for name in names:
                each.put(event_key(name, "public"), json.dumps(EVENT), attachment=stamp)
                each.put(frame_key(name, "public"), b"\0" * 40, attachment=stamp)
                keep.append(each.liveliness().declare_token(alive_key(name)))
        assert asked(stranger, "**") == []
        # its own comes after what it said as others
        keep.append(session.liveliness().declare_token(alive_key("mine")))
        until(
            "its own edge is seen", lambda: [r["robot"] for r in httpx.get(url).json()["robots"]] == ["mine"]
        )
        assert asked(session, echo_key("mine")) == [echo_key("mine")]
        assert asked(session, echo_key("other")) == []
        assert heard == []
        del keep
    until(
        "the stranger is told of",
        lambda: "does not list the common name of its certificate" in relay.errors(),
    )


def test_none_an_expired_one_and_one_of_another_authority_are_refused(lab: Lab, tmp_path: Path) -> None:
    good = lab.certificate("hubo")
    lab.robots("add", "hubo", "--certificate")
    relay = lab.start()
    cases = {
        # it does not know the relay's authority either, which is what it finds first
        "none": (None, "a certificate that can't be trusted"),
        "expired": (
            lab.certificate("hubo", days=-1),
            "robot's certificate: certificate expired",
        ),
        "stolen": (lab.certificate("hubo", authority="theirs"), "certificate: "),
        "misnamed": (
            lab.certificate("g1"),
            "does not know 'hubo', or the certificate has another name",
        ),
    }
    for name in ("none", "expired", "stolen"):
        with pytest.raises(zenoh.ZError):
            lab.open(relay, cases[name][0], patience_ms=300).close()  # type: ignore[no-untyped-call]
    with ExitStack() as running:
        agents = {}
        for name, (proof, _) in cases.items():
            agents[name] = lab.agent(relay, "hubo", proof, tmp_path / name)
            running.callback(agents[name].wait, 15)
            running.callback(agents[name].terminate)
        for name, (_, says) in cases.items():
            until(f"{name}: the edge says why", partial(told, tmp_path / name, says), 30.0)
        assert httpx.get(f"http://{relay.address}/api/v1/robots").json()["robots"] == []
        until("the relay says so", lambda: "publisher refused" in relay.errors())

        agents["good"] = lab.agent(relay, "hubo", good, tmp_path / "good")
        running.callback(agents["good"].wait, 15)
        running.callback(agents["good"].terminate)
        state = f"http://{relay.address}/api/v1/robots/hubo/state"
        until("the good one is on air", lambda: httpx.get(state).status_code == 200, 30.0)
        lab.robots("remove", "hubo")
        until("removed, it is gone", lambda: httpx.get(state).status_code == 404, 30.0)
    port = re.search(r"metrics on http://[^:]+:(\d+)", relay.errors())
    assert port is not None
    text = httpx.get(f"http://127.0.0.1:{port[1]}/metrics").text
    counted = re.search(r"^posecast_publishers_refused_total (\S+)$", text, re.MULTILINE)
    assert counted is not None
    assert float(counted[1]) >= 4
