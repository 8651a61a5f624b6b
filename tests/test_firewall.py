"""An agent behind a campus's firewall, in a network namespace of its own: the only way out is an HTTP proxy,
which allows port 443 alone. Page and robots share that port, as with infra/one-port.yml."""

from __future__ import annotations

import os
import shutil
import socket
import ssl
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import until

from .conftest import BIN
from .namespaces import NEAR, Cable
from .test_first_start import start as make_secrets

SITE = "lab.example"  # known to the proxy alone, like the robots' name
NAME = f"robots.{SITE}"
LOGIN = "campus:pass word"
INFRA = Path(__file__).resolve().parent.parent / "infra"
OTHERS = "10.9.9."  # visitors' addresses
RELAY = "127.0.0.1:7440"
ENTRANCE = "127.0.0.1:7443"  # published as port 443


MODULES = Path("/etc/nginx/modules-enabled")


def has_streams() -> bool:
    """Whether nginx is here with its module for streams, built in or as Debian's plug-in."""
    if shutil.which("nginx") is None:
        return False
    built = subprocess.run(["nginx", "-V"], stderr=subprocess.PIPE, text=True, check=True).stderr
    return "--with-stream" in built.split() or any(MODULES.glob("*-stream.conf"))


pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl here")


@pytest.fixture
def firewall() -> Iterator[Cable]:
    """The robot is at the far end; of the near one, it reaches only the proxy."""
    made = Cable()
    made.near.do(*(f"ip address add {OTHERS}{n}/32 dev lo" for n in (1, 2)))
    yield made
    made.close()


class Campus:
    """The site at the near end, and the campus's proxy."""

    def __init__(self, stack: Any, folder: Path, firewall: Cable, shares_port: bool) -> None:
        make_secrets(folder, f"{SITE}, {NAME}")
        self._stack, self._folder, self._firewall = stack, folder, firewall
        secret = folder / "secret"
        tls = ("--zenoh-tls-cert", str(secret / "relay.pem"), "--zenoh-tls-key", str(secret / "relay.key"))
        limits = ("--trusted-proxies", "127.0.0.1", "--max-per-address", "1")
        robots = ("--robots", str(folder / "robots/robots.toml"))
        listen = ("--port", "8080", "--zenoh-listen", f"tls/{RELAY}")
        relay = self._start("relay", f"{BIN}/posecast-relay", "run", *listen, *tls, *limits, *robots)
        relay.line("robots on tls/127")
        if shares_port:
            self._start_nginx()
            self._start_caddy()
        lead = f"{NAME}:443={ENTRANCE if shares_port else RELAY}"
        proxy = (sys.executable, "-m", "posecast_testing.connect_proxy", NEAR, "3128", LOGIN)
        self.proxy = self._start("proxy", "env", f"LEAD={lead}", *proxy)

    def _start(self, *words: str) -> Any:
        return self._firewall.near.run(lambda: self._stack.start(*words))

    def _start_nginx(self) -> None:
        text = (INFRA / "robots.conf").read_text()
        for old, new in {
            "pid /tmp/nginx.pid": f"pid {self._folder}/nginx.pid",
            "relay:7447": RELAY,
            "proxy:443": "127.0.0.1:443",
        }.items():
            assert old in text
            text = text.replace(old, new)
        (self._folder / "robots.conf").write_text(text)
        more = f"daemon off; include {MODULES}/*.conf;"
        if not os.getuid():
            more += " user root;"
        self._start("nginx", "nginx", "-c", str(self._folder / "robots.conf"), "-g", more)

    def _start_caddy(self) -> None:
        settings = {
            "PATH": f"{BIN}:{os.environ['PATH']}",
            "SITE": f"{SITE}, {NAME}",
            "VIEWERS_AT": "127.0.0.1",
            "ADMIN_AT": "127.0.0.1",
            "PAGE": str(self._folder),
            "ENTRANCE": "127.0.0.1/32",
            "XDG_DATA_HOME": str(self._folder),
            "XDG_CONFIG_HOME": str(self._folder),
        }
        words = [f"{name}={value}" for name, value in settings.items()]
        run = (str(INFRA / "start_proxy.sh"), "--config", str(INFRA / "Caddyfile"), "--adapter", "caddyfile")
        self._start("caddy", "env", *words, *run)
        root = self._folder / "caddy/pki/authorities/local/root.crt"
        until("Caddy has made its authority", root.is_file, 60)
        self._trust = ssl.create_default_context(cafile=str(root))

    def run(self, *words: str, **environment: str) -> Any:
        """`posecast-edge` at the far end."""
        proof = ("--credential", str(self._folder / "secret/demo.credential"), "--relay", f"tls/{NAME}:443")
        variables = [f"{name}={value}" for name, value in environment.items()]
        command = ("env", *variables, f"{BIN}/posecast-edge", *words, *proof)
        return self._firewall.far.run(lambda: self._stack.start("edge", *command))

    def open_stream(self, address: str) -> ssl.SSLSocket:
        """A visitor's stream through the port that robots use, too."""
        host, _, port = ENTRANCE.rpartition(":")
        plain = socket.create_connection((host, int(port)), 20, source_address=(address, 0))
        link = self._trust.wrap_socket(plain, server_hostname=SITE)
        link.sendall(f"GET /api/v1/robots/demo/live.sse?hz=1 HTTP/1.1\r\nHost: {SITE}\r\n\r\n".encode())
        return link

    def read_first_events(self) -> list[str]:
        """What two visitors with one address and a third with another are told."""

        def read() -> list[str]:
            links = [self.open_stream(f"{OTHERS}{n}") for n in (1, 1, 2)]
            try:
                texts = [link.makefile("r", encoding="utf-8", newline="\n") for link in links]
                return [
                    next(line for line in text if line.startswith("event: ")).split()[1] for text in texts
                ]
            finally:
                for link in links:
                    link.close()

        return self._firewall.near.run(read)


@pytest.mark.parametrize("shares_port", [False, True], ids=["relay on 443", "page and robots on 443"])
def test_an_agent_whose_only_way_out_is_a_proxy_to_443_is_on_air(
    stack: Any, tmp_path: Path, firewall: Cable, shares_port: bool
) -> None:
    if shares_port and not (BIN / "caddy").exists():
        pytest.skip("no caddy in the virtual environment")
    if shares_port and not has_streams():
        pytest.skip("no nginx with streams: apt-get install libnginx-mod-stream")
    campus = Campus(stack, tmp_path, firewall, shares_port)
    url = f"http://{LOGIN.replace(' ', '%20')}@{NEAR}:3128"

    alone = campus.run("run", "--source", "demo", "--hz", "5")
    until("it says that the name is unknown", lambda: "is unknown here" in alone.log, 60)
    alone.stop()
    edge = campus.run("run", "--source", "demo", HTTPS_PROXY=url)
    until("the robot is on air", lambda: "on air" in edge.log, 60)
    assert f"CONNECT {NAME}:443 HTTP/1.1" in campus.proxy.log
    assert f"linked to tls/{NAME}:443 through the proxy {NEAR}:3128" in edge.log

    if shares_port:
        events = campus.read_first_events()
        assert sorted(events[:2]) == ["bye", "hello"], "the two visitors with one address count together"
        assert events[2] == "hello"

    doctor = campus.run("doctor", https_proxy=url)
    until("the doctor is done", lambda: doctor.process.poll() is not None, 60)
    assert doctor.process.returncode == 0, doctor.log
    for step in ("name", "proxy", "TLS", "Zenoh", "credential"):
        assert f"\n  {step} " in f"\n{doctor.log}", doctor.log
    assert f"certificate of relay, {SITE}, {NAME}, issued by Posecast, this cloud's own" in doctor.log
    assert "accepts 'demo'" in doctor.log
    for log in (alone.log, edge.log, doctor.log):
        assert "pass%20word" not in log
        assert "pass word" not in log
