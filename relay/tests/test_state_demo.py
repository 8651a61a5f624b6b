"""The demo robot's balance as `/state` tells it, from its agent by a relay, and by a gateway behind Redis."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_relay.http.answers import BalanceState
from posecast_testing import until

from .redis_server import Redis
from .stage import Relay

MASS_KG = 42.0
WEIGHT_N = MASS_KG * 9.81
BUNDLE = Path(__file__).resolve().parents[2] / "edge-agent/src/posecast_edge/demo_bundle/model/manifest.json"

pytestmark = pytest.mark.skipif(not BUNDLE.is_file(), reason="the demo robot is not built (make setup)")


@pytest.fixture
def demo(tmp_path: Path) -> Iterator[Callable[[Relay], None]]:
    """Starts the agent with the demo robot at a relay."""
    agents: list[subprocess.Popen[bytes]] = []

    def start(relay: Relay) -> None:
        edge = str(Path(sys.executable).parent / "posecast-edge")
        command = [edge, "run", "--robot", "demo", "--source", "demo", "--relay", relay.zenoh]
        with (tmp_path / "agent.log").open("wb") as log:
            agents.append(subprocess.Popen(command, stderr=log))

    yield start
    for agent in agents:
        agent.terminate()
        agent.wait(timeout=20)


def read_balance(relay: Relay) -> dict[str, Any] | None:
    """Of a frame in which it stands; None until there is one."""
    answer = httpx.get(f"http://{relay.address}/api/v1/robots/demo/state", timeout=10)
    found: dict[str, Any] = answer.json().get("balance", {}) if answer.status_code == 200 else {}
    feet = found.get("feet", {}).values()
    return found if feet and all(foot["bears"] for foot in feet) else None


def check(found: dict[str, Any]) -> None:
    """Every value is there and is what a robot of that weight on both feet can have."""
    assert (found["mass_kg"], found["ground"], found["why"]) == (MASS_KG, "measured", {})
    assert None not in found.values()
    described = BalanceState.model_validate(found)  # as /openapi.json describes it
    assert described.model_fields_set == BalanceState.model_fields.keys() - {"detail"}
    x, y, height = found["centre_of_mass_m"]
    assert 0.3 < height - found["floor_m"] < 1.2
    assert len(found["support_polygon_m"]) >= 4
    assert math.isfinite(found["margin_mm"])
    assert math.dist(found["centre_of_pressure_m"][:2], (x, y)) < 0.5
    assert found["feet"].keys() == {"RF", "LF"}
    assert all(foot["centre_of_pressure_m"] for foot in found["feet"].values())
    assert sum(foot["force_n"] for foot in found["feet"].values()) == pytest.approx(WEIGHT_N, rel=0.4)


def test_a_relay_tells_all_of_the_demo_robots_balance(relay: Relay, demo: Callable[[Relay], None]) -> None:
    demo(relay)
    check(until("a balance on both feet", lambda: read_balance(relay), 60))


@pytest.mark.full  # that gateways know what the state needs, `test_gateway` and `test_state_balance` say
def test_a_gateway_behind_redis_tells_it_too(
    relays: Callable[..., Relay], redis_server: Redis, demo: Callable[[Relay], None]
) -> None:
    flags = ("--store", redis_server.url)
    ingest, gateway = relays("--role", "ingest", *flags), relays("--role", "gateway", *flags)
    demo(ingest)
    check(until("a balance on both feet", lambda: read_balance(gateway), 60))
