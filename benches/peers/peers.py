"""Who is measured, how each is started, and what its viewers have to say before frames come."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from posecast_testing import free_port

from benches.peers import mqtt
from relay.benches.build import ROOT
from relay.benches.scenarios import Scenario
from relay.benches.servers import Place, Server, hear, serving, started, wait_port

HERE = Path(__file__).resolve().parent
OUT = ROOT / "out" / "peers"  # ignored by git
VENV_PYTHON = OUT / "venv" / "bin" / "python"
NODE_MODULES = OUT / "node_modules"
RELAY = "posecast"

Options = dict[str, object]  # of the program `viewers`
Start = Callable[[Scenario, Place], Iterator[Server]]


@dataclass(frozen=True)
class Peer:
    """One server. `viewers`: options of the program that plays its viewers."""

    name: str
    title: str
    needs: Callable[[], str | None]  # what is missing, in a few words
    start: Start
    path: str = "/"
    viewers: Callable[[Scenario], Options] = field(default=lambda _: {})


def nothing() -> str | None:
    return None


def node_package(name: str) -> Callable[[], str | None]:
    def missing() -> str | None:
        return None if (NODE_MODULES / name).is_dir() else f"npm package {name} is not installed"

    return missing


def python_package(name: str) -> Callable[[], str | None]:
    def missing() -> str | None:
        found = list((OUT / "venv").glob(f"lib/python*/site-packages/{name}"))
        return None if found else f"Python package {name} is not installed"

    return missing


def program(name: str) -> Callable[[], str | None]:
    return lambda: None if find(name) else f"no {name}"


def find(name: str) -> str | None:
    """A program of the system, or one that was built here. Debian keeps servers in sbin."""
    return shutil.which(name, path=f"{OUT / 'bin'}:/usr/sbin:/usr/local/sbin") or shutil.which(name)


def feeding(scenario: Scenario, place: Place) -> list[str]:
    """What every server or robot of a peer is told."""
    asked = {"--hz": scenario.hz, "--bytes": scenario.frame_bytes, "--stamps": place.stamps}
    return [str(part) for pair in asked.items() for part in pair]


def own_server(*command: str) -> Start:
    """A program that makes its frames itself and says `PORT n`."""

    def start(scenario: Scenario, place: Place) -> Iterator[Server]:
        words = [*command, *feeding(scenario, place)]
        with started(place, place.server_core, "server", *words) as server:
            yield Server(server.process.pid, int(hear(server, r"^PORT (\d+)$")[1]), "", None)

    return start


def broker(name: str, protocol: str, settings: Callable[[int, int], str], flag: str) -> Start:
    """A broker with a listener for robots and one for browsers, and its robot beside it."""

    def start(scenario: Scenario, place: Place) -> Iterator[Server]:
        tcp, web = free_port(), free_port()
        configuration = place.out / f"{name}.conf"
        configuration.write_text(settings(tcp, web))
        feed = [sys.executable, "-m", "benches.peers.servers.broker_feed", protocol, str(tcp)]
        feed += feeding(scenario, place)
        command = (find(name) or name, flag, str(configuration))
        with started(place, place.server_core, "server", *command) as server:
            for port in (tcp, web):
                wait_port(port)
            with started(place, place.other_core, "robot", *feed) as robot:
                hear(robot, "^READY$")
                yield Server(server.process.pid, web, "", None)

    return start


def mosquitto_settings(tcp: int, web: int) -> str:
    lines = ["user root", "allow_anonymous true", "persistence false", "set_tcp_nodelay true"]
    lines += [f"listener {tcp} 127.0.0.1", f"listener {web} 127.0.0.1", "protocol websockets"]
    return "\n".join(lines) + "\n"


def nats_settings(tcp: int, web: int) -> str:
    web_settings = f'{{ host: "127.0.0.1", port: {web}, no_tls: true }}'
    return f'host: "127.0.0.1"\nport: {tcp}\nwebsocket: {web_settings}\n'


def the_relay(scenario: Scenario, place: Place) -> Iterator[Server]:
    with serving("relay", scenario, place) as server:
        yield server


def mqtt_viewers(scenario: Scenario) -> Options:
    skip = len(mqtt.publish(bytes(scenario.frame_bytes))) - scenario.frame_bytes
    greeting = (mqtt.connect() + mqtt.subscribe()).hex()
    return {"--subprotocol": "mqtt", "--greet": f"hex:{greeting}", "--skip": skip, "--acks": 0}


def nats_viewers(scenario: Scenario) -> Options:
    greeting = b'CONNECT {"verbose":false,"pedantic":false}\r\nSUB f 1\r\n'.hex()
    skip = len(f"MSG f 1 {scenario.frame_bytes}\r\n")
    return {"--greet": f"hex:{greeting}", "--skip": skip, "--acks": 0}


def foxglove_viewers(_scenario: Scenario) -> Options:
    greeting = '{"op":"subscribe","subscriptions":[{"id":1,"channelId":1}]}'
    # message data: opcode, subscription u32, log time u64
    return {"--subprotocol": "foxglove.sdk.v1", "--greet": f"text:{greeting}", "--skip": 13, "--acks": 0}


PEERS = (
    Peer(RELAY, "posecast-relay, fed through Zenoh", nothing, the_relay),
    Peer(
        "ws", "ws 8.23.0 (Node): a loop of send()", node_package("ws"),
        own_server("node", str(HERE / "servers" / "ws_loop.cjs")),
    ),
    Peer(
        "socket.io", "Socket.IO 4.8.4 (Node): io.emit()", node_package("socket.io"),
        own_server("node", str(HERE / "servers" / "socket_io.cjs")), "/socket.io/?EIO=4&transport=websocket",
        lambda _: {"--greet": "text:40", "--acks": 0},
    ),
    Peer(
        "tornado", "Tornado 6.6.1, under rosbridge: a loop of write_message()", python_package("tornado"),
        own_server(str(VENV_PYTHON), "-m", "benches.peers.servers.tornado_loop"), "/live",
    ),
    Peer(
        "foxglove", "foxglove-sdk 0.30.3 (Rust): one channel", python_package("foxglove"),
        own_server(str(VENV_PYTHON), "-m", "benches.peers.servers.foxglove_channel"), "/", foxglove_viewers,
    ),
    Peer(
        "mosquitto", "Mosquitto (C): MQTT at QoS 0 over WebSocket", program("mosquitto"),
        broker("mosquitto", "mqtt", mosquitto_settings, "-c"), "/mqtt", mqtt_viewers,
    ),
    Peer(
        "nats", "nats-server (Go): over WebSocket", program("nats-server"),
        broker("nats-server", "nats", nats_settings, "-c"), "/", nats_viewers,
    ),
)  # fmt: skip


@contextmanager
def serve(peer: Peer, scenario: Scenario, place: Place) -> Iterator[Server]:
    """The peer's server. CannotStart, one line, when it doesn't."""
    with contextmanager(peer.start)(scenario, place) as server:
        yield Server(server.pid, server.port, server.path or peer.path, None)
