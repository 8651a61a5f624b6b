"""Faults in the store: gateways report them and recover; a relay with its own robots does not notice."""

from __future__ import annotations

import signal
import socket
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest
from posecast_testing import Process, until

from relay.tests.redis_cluster import Cluster
from tests.conftest import Stack
from tests.faults.conftest import Scene, Screen, killed, signalled


class Hall(NamedTuple):
    """A Redis between an ingest that also serves viewers (`all`) and a gateway; a screen on each."""

    redis: Process | None
    url: str
    beside: Screen
    behind: Screen


def hall(scene: Scene) -> Hall:
    """With one of its own."""
    url = scene.stack.redis()
    return hall_at(scene, url, scene.stack.parts[-1])


def hall_at(scene: Scene, url: str, redis: Process | None = None) -> Hall:
    """With the store of this URL."""
    _, address, zenoh = scene.stack.relay(store=url)
    _, gateway, _ = scene.stack.relay(store=url, flags=("--role", "gateway"))
    _, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    beside, behind = scene.screen(address), scene.screen(gateway)
    for screen in (beside, behind):
        screen.says("LIVE")
    return Hall(redis, url, beside, behind)


def restart(stack: Stack, url: str) -> None:
    """The same port, empty."""
    port = url.rsplit(":", 1)[1].split("/", maxsplit=1)[0]
    stack.start(
        "redis", *("redis-server", "--port", port, "--bind", "127.0.0.1", "--save", "", "--appendonly", "no")
    )
    until("redis listens", lambda: listens(int(port)))


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def test_redis_killed(scene: Scene) -> None:
    made = hall(scene)
    assert made.redis is not None
    at_s = killed(made.redis)
    degraded_s = made.behind.says("STALE", "relay degraded", at_s)
    began_s = time.monotonic()
    restart(scene.stack, made.url)
    back_s = made.behind.says("LIVE", since_s=began_s)
    check(made, at_s)
    scene.tell(degraded=degraded_s, LIVE_again=back_s)


@pytest.mark.full
@pytest.mark.parametrize("outage_s", [0, 60], ids=["", "for a minute"])
def test_redis_frozen(scene: Scene, outage_s: float) -> None:
    made = hall(scene)
    assert made.redis is not None
    at_s = signalled(made.redis, signal.SIGSTOP)
    degraded_s = made.behind.says("STALE", "relay degraded", at_s)
    until("the outage is over", lambda: time.monotonic() - at_s >= outage_s, outage_s + 20)
    back_s = made.behind.says("LIVE", since_s=signalled(made.redis, signal.SIGCONT))
    check(made, at_s)
    scene.tell(degraded=degraded_s, LIVE_again=back_s)


@pytest.mark.full
@pytest.mark.parametrize("command", [b"FLUSHALL", b"CLIENT KILL TYPE pubsub"])
def test_redis_loses_everything(scene: Scene, command: bytes) -> None:
    """Emptied, or without its listeners: at worst a short interruption, never a wrong picture."""
    made = hall(scene)
    at_s = time.monotonic()
    with socket.create_connection(("127.0.0.1", int(made.url.rsplit(":", 1)[1].split("/")[0]))) as link:
        link.sendall(command + b"\r\n")
        assert link.recv(64)[:1] in b"+:"
    made.behind.watches(30, since_s=at_s + 0.5)
    gap_s = longest_gap_s(made.behind, at_s)
    check(made, at_s)
    scene.tell(longest_gap=gap_s)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """Three masters, each with a replica."""
    made = Cluster(tmp_path)
    try:
        made.start(replicas=True)
        yield made
    finally:
        made.stop()


@pytest.mark.full
@pytest.mark.parametrize("how", ["its master killed", "told to hand over"])
def test_redis_fails_over(scene: Scene, cluster: Cluster, how: str) -> None:
    """The replica of the node that has the robot takes its place."""
    made = hall_at(scene, cluster.url)
    place = cluster.place("demo")
    master, replica = cluster.masters[place], cluster.replicas[place]
    at_s = time.monotonic()
    degraded_s = 0.0
    if how == "told to hand over":
        replica.ask("CLUSTER", "FAILOVER")
    else:
        master.kill()
        degraded_s = made.behind.says("STALE", "relay degraded", at_s)
    until("the replica is the master", lambda: replica.ask("ROLE")[0] == b"master", 30.0)
    promoted_s = time.monotonic() - at_s
    made.behind.watches(30, since_s=at_s + promoted_s + 0.5)
    back_s = max(0.0, word_s(made.behind, at_s) - promoted_s)
    check(made, at_s)
    gap_s = longest_gap_s(made.behind, at_s)
    scene.tell(degraded=degraded_s, promoted=promoted_s, LIVE_again=back_s, longest_gap=gap_s)


def word_s(screen: Screen, since_s: float) -> float:
    """The time of its last word, which must be LIVE; 0 if it has said none."""
    said = screen.lines("word", since_s)
    assert screen.word == "LIVE"
    return float(said[-1]["at"]) - since_s if said else 0.0


def longest_gap_s(screen: Screen, since_s: float) -> float:
    times: list[float] = [since_s, *(frame["at"] for frame in screen.frames(since_s))]
    return max(b - a for a, b in pairwise(times))


def check(made: Hall, at_s: float) -> None:
    """What holds whatever happened to Redis."""
    assert made.beside.lines("word", at_s) == []
    made.behind.watches(20, since_s=time.monotonic())
    assert made.behind.word == "LIVE"
    for screen in (made.beside, made.behind):
        screen.never_lied()
