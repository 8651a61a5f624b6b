"""Two routers with infra/mesh/zenohd.json5: the robot connects to one, the relay to the other.

The routers are those of Zenoh's Python package; zenohd is the same router as a program.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
import zenoh
from posecast_relay.zenoh.router import make_access_control
from posecast_testing import Process, free_port, until
from posecast_wire import Stamp, alive_key, echo_key, event_key, frame_key

from tests.conftest import BIN, Stack

FILE = Path(__file__).parents[1] / "infra/mesh/zenohd.json5"
ROUTERS = ("router-1", "router-2")
EC = "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes"
OPEN = (
    "import signal, sys, zenoh\n"
    "session = zenoh.open(zenoh.Config.from_file(sys.argv[1]))\n"
    "print('open', flush=True)\n"
    "signal.pause()\n"
)
ROBOTS = "".join(f"[robots.{name}.anyone]\n" for name in ("hubo", "other", "g1"))


@dataclass
class Mesh:
    """Its certificates, its ports, its routers."""

    stack: Stack
    ports: dict[str, int] = field(default_factory=lambda: {name: free_port() for name in ROUTERS})

    def __post_init__(self) -> None:
        folder = self.stack.folder
        (folder / "names").write_text("subjectAltName=IP:127.0.0.1\nbasicConstraints=CA:FALSE\n")
        self._openssl(f"req -x509 {EC} -days 2 -subj /CN=authority -keyout ca.key -out ca.pem")
        for n, name in enumerate((*ROUTERS, "hubo", "g1"), 2):
            self._openssl(f"req {EC} -subj /CN={name} -keyout {name}.key -out asked.pem")
            signed = f"-CA ca.pem -CAkey ca.key -set_serial {n} -extfile names -days 2 -out {name}.pem"
            self._openssl(f"x509 -req -in asked.pem {signed}")

    def _openssl(self, words: str) -> None:
        subprocess.run(["openssl", *words.split()], cwd=self.stack.folder, check=True, capture_output=True)

    def at(self, router: str) -> str:
        """The address for robots."""
        return f"tls/127.0.0.1:{self.ports[router]}"

    def router(self, name: str, *connects: str) -> Process:
        """From the file, with this machine's addresses and files."""
        config = zenoh.Config.from_file(str(FILE))
        for key, value in {
            "listen/endpoints": [self.at(name)],
            "connect/endpoints": connects,
            **self._tls(name, ("listen", "connect")),
        }.items():
            config.insert_json5(key, json.dumps(value))
        path = self.stack.folder / f"{name}.json"
        path.write_text(str(config))
        part = self.stack.start(name, sys.executable, "-c", OPEN, str(path))
        part.line("open")
        return part

    def client(self, name: str, router: str) -> zenoh.Session:
        """A session as an agent has it, by that certificate."""
        config = zenoh.Config()
        for key, value in {
            "mode": "client",
            "connect/endpoints": [self.at(router)],
            "connect/timeout_ms": 5000,
            "scouting/multicast/enabled": False,
            "transport/shared_memory/enabled": False,
            "transport/link/tls/enable_mtls": True,
            **self._tls(name, ("connect",)),
        }.items():
            config.insert_json5(key, json.dumps(value))
        return zenoh.open(config)

    def _tls(self, name: str, ends: tuple[str, ...]) -> dict[str, str]:
        folder = self.stack.folder
        tls = {"root_ca_certificate": folder / "ca.pem"}
        for end in ends:
            tls |= {
                f"{end}_certificate": folder / f"{name}.pem",
                f"{end}_private_key": folder / f"{name}.key",
            }
        return {f"transport/link/tls/{key}": str(path) for key, path in tls.items()}

    def agent(self, robot: str, router: str) -> Process:
        """The real one."""
        folder = self.stack.folder
        own = ("--tls-cert", str(folder / f"{robot}.pem"), "--tls-key", str(folder / f"{robot}.key"))
        words = ("run", "--robot", robot, "--source", "demo", "--relay", self.at(router))
        command = (f"{BIN}/posecast-edge", *words, *own, "--tls-ca", str(folder / "ca.pem"))
        return self.stack.start("edge", *command)


@pytest.fixture
def mesh(stack: Stack) -> Mesh:
    """Nothing runs yet."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl here")
    return Mesh(stack)


def test_a_robot_may_do_at_a_router_what_it_may_do_at_the_relay() -> None:
    shown = json.loads(zenoh.Config.from_file(str(FILE)).get_json("access_control"))
    ours = make_access_control(["hubo"], "cert_common_names")
    assert shown["default_permission"] == "deny"
    assert [rule for rule in map(said, shown["rules"]) if rule["id"] != "mesh"] == ours["rules"]
    assert said(shown["subjects"][-1]) == ours["subjects"][0]
    assert said(shown["policies"][-1]) == ours["policies"][0]


def said(part: dict[str, Any]) -> dict[str, Any]:
    """Without the omitted settings."""
    return {name: value for name, value in part.items() if value is not None}


def test_a_robot_at_one_router_is_seen_at_the_relay_beside_the_other(mesh: Mesh) -> None:
    stack = mesh.stack
    robots = stack.folder / "robots.toml"
    robots.write_text(ROBOTS)
    robots.chmod(0o600)
    flags = ("--robots", str(robots), "--metrics-port", "0", "--log-level", "info")
    relay, address, beside = stack.relay(flags=flags)
    first = mesh.router(ROUTERS[0], beside, mesh.at(ROUTERS[1]))
    mesh.router(ROUTERS[1], mesh.at(ROUTERS[0]))
    mesh.agent("hubo", ROUTERS[1])
    robot_url = f"http://{address}/api/v1/robots/hubo"

    def robot() -> dict[str, Any]:
        answer = httpx.get(robot_url, trust_env=False)
        return dict(answer.json()) if answer.status_code == 200 else {"status": None, "seq": 0}

    until("on air", lambda: robot()["status"] == "online", 60)
    until("its model is known", lambda: robot()["model"], 60)
    manifest = f"{robot_url}/model/{robot()['model']}/manifest.json"
    assert httpx.get(manifest, trust_env=False, timeout=30).status_code == 200

    # a robot speaks for itself only, whatever router it is at; who is not named speaks for nobody
    stamp = Stamp(run_id=7, elapsed_ns=1).pack()
    fault = {"type": "event", "t": 1.0, "level": "fault", "source": "x", "text": "x", "state": "on"}
    for name, answers in (("hubo", [echo_key("hubo")]), ("g1", [])):
        with mesh.client(name, ROUTERS[0]) as session:
            tokens = [session.liveliness().declare_token(alive_key(other)) for other in ("other", "g1")]
            for other in ("other", "g1"):
                session.put(frame_key(other, "public"), b"\0" * 40, attachment=stamp)
                session.put(event_key(other, "public"), json.dumps(fault), attachment=stamp)
            replies = session.get(echo_key("hubo"), timeout=5.0)  # comes after what was put
            assert [str(reply.ok.key_expr) for reply in replies if reply.ok is not None] == answers
            del tokens
    listed = httpx.get(f"http://{address}/api/v1/robots", trust_env=False).json()["robots"]
    assert [each["robot"] for each in listed] == ["hubo"]

    metrics = until("metrics", lambda: re.search(r"metrics on (http://\S+/metrics)", relay.log))[1]
    seq = robot()["seq"]
    until("it goes on", lambda: robot()["seq"] > seq + 30)
    text = httpx.get(metrics, trust_env=False).text
    outcomes = {
        k: float(v) for k, v in re.findall(r'^posecast_edge_frames_total{fate="(.+)"} (\S+)$', text, re.M)
    }
    assert outcomes["taken"] > 30
    assert outcomes.get("repeated", 0) == 0, "no frame comes twice"

    first.kill()
    until("it is away", lambda: robot()["status"] == "offline")
    mesh.router(ROUTERS[0], beside, mesh.at(ROUTERS[1]))
    until("it is back", lambda: robot()["status"] == "online", 60)
    relay.kill()
    http, zenoh_port = (int(each.rpartition(":")[2]) for each in (address, beside))
    stack.relay(http, zenoh_port, flags=flags)
    until("it is at the new relay", lambda: robot()["status"] == "online", 60)
