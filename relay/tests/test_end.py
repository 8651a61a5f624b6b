"""SIGTERM ends a relay with status 0 by 10 s, whatever its role does and however Redis is."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import until

from .redis_server import Redis
from .stage import Relay, Watcher

BY_S = 10.0


async def ends(relays: list[Relay]) -> None:
    """All are told to go at once."""
    began = time.monotonic()
    for relay in relays:
        relay.process.send_signal(signal.SIGTERM)
    for relay in relays:
        left_s = began + BY_S - time.monotonic()
        assert await asyncio.to_thread(relay.process.wait, left_s) == 0
        assert "connections are still open" not in relay.errors()


@pytest.mark.parametrize(
    "how", ["frozen", *(pytest.param(how, marks=pytest.mark.full) for how in ("alive", "dead"))]
)
async def test_every_role_ends_however_redis_is(
    relays: Any, edges: Any, redis_server: Redis, how: str
) -> None:
    """With viewers that stay, at a gateway and beside it one without any."""
    flags = ("--store", redis_server.url)
    everything = relays("--role", "all", *flags)
    gateways = [relays("--role", "gateway", *flags) for _ in range(2)]
    edges(everything.zenoh)
    async with AsyncExitStack() as stack:
        for relay in (everything, gateways[0]):
            for robot in ("r", "r", "nobody"):
                viewer = await stack.enter_async_context(Watcher(relay.url(robot)))
                await viewer.until("what is there", lambda v: v.told("status"))
        if how == "dead":
            await asyncio.to_thread(redis_server.kill)
        elif how == "frozen":
            redis_server.freeze()
        await ends([everything, *gateways])


@pytest.mark.full
@pytest.mark.parametrize("seconds", [0.0, 0.1, 0.3, 0.6, 1.0])
async def test_an_ingest_and_gateways_end_at_any_moment_of_an_outage(
    relays: Any, edges: Any, redis_server: Redis, seconds: float
) -> None:
    flags = ("--store", redis_server.url)
    ingest = relays("--role", "ingest", *flags)
    gateways = [relays("--role", "gateway", *flags) for _ in range(3)]
    edges(ingest.zenoh)
    async with AsyncExitStack() as stack:
        for gateway in gateways[:2]:
            viewer = await stack.enter_async_context(Watcher(gateway.url()))
            await viewer.until("a frame", lambda v: v.frames)
        await asyncio.to_thread(redis_server.kill)
        await asyncio.sleep(seconds)  # the moment is what is tried, not waited for
        if seconds > 0.5:
            await asyncio.to_thread(redis_server.start)
        await ends([ingest, *gateways])


def test_a_signal_while_it_starts_is_status_0(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "posecast_relay.cli", "run", "--dev", "--port", "0"]
    errors = tmp_path / "errors"
    with errors.open("wb") as to:
        process = subprocess.Popen(
            [*command, "--zenoh-listen", "tcp/127.0.0.1:0"], stdout=subprocess.DEVNULL, stderr=to
        )
    catches = 1 << (signal.SIGTERM - 1)

    def caught() -> bool:
        status = Path(f"/proc/{process.pid}/status").read_text()
        found = [line.split()[1] for line in status.splitlines() if line.startswith("SigCgt")]
        return bool(int(found[0], 16) & catches)

    until("it hears the signal", caught)
    process.send_signal(signal.SIGTERM)
    assert process.wait(BY_S) == 0
    assert errors.read_text() == ""


def test_a_thread_that_never_ends_is_not_waited_for(
    relays: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a library may leave one behind."""
    (tmp_path / "sitecustomize.py").write_text(
        "import threading; threading.Thread(target=threading.Event().wait).start()\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    relay = relays()
    relay.process.send_signal(signal.SIGTERM)
    assert relay.process.wait(BY_S) == 0
    assert "connections are still open" not in relay.errors()


NO_ANSWER = """
ip link add v0 type veth peer name v1 && ip link set lo up && ip link set v0 up && ip link set v1 up
ip addr add 192.0.2.2/24 dev v0 && ip neigh add 192.0.2.53 lladdr 02:00:00:00:00:01 dev v0
echo nameserver 192.0.2.53 > resolv.conf && mount --bind resolv.conf /etc/resolv.conf
exec "$@"
"""


@pytest.fixture
def without_names(tmp_path: Path) -> list[str]:
    """A command in front of which names are asked for at a server that never answers."""
    inside = ["unshare", "-m", "-n", "sh", "-ec", NO_ANSWER, "sh"]
    if os.geteuid() != 0:
        pytest.skip("needs root for a namespace of its own")
    if subprocess.run([*inside, "true"], cwd=tmp_path, capture_output=True, check=False).returncode:
        pytest.skip("no namespaces here")
    return inside


def test_a_name_server_that_does_not_answer_holds_nothing_up(
    without_names: list[str], tmp_path: Path
) -> None:
    command = [sys.executable, "-m", "posecast_relay.cli", "run", "--dev", "--role", "gateway", "--port", "0"]
    errors = tmp_path / "errors"
    with errors.open("wb") as to:
        process = subprocess.Popen(
            [*without_names, *command, "--store", "redis://wrong"],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=to,
        )
    assert process.stdout is not None
    assert process.stdout.readline().startswith(b"posecast-relay: serving")
    until("both connections", lambda: errors.read_text().count("redis: TimeoutError") == 2)
    process.send_signal(signal.SIGTERM)
    assert process.wait(BY_S) == 0
    process.stdout.close()
    assert errors.read_text().count("\n") == 2  # said once each, and no lookup left behind to complain
