"""Faults between robot and viewers."""

from __future__ import annotations

import signal
import time
from statistics import quantiles

import pytest
from posecast_testing import free_port, until

from tests.faults.conftest import Scene, killed, signalled


def ports(address: str, zenoh: str) -> tuple[int, int]:
    return int(address.rsplit(":", 1)[1]), int(zenoh.rsplit(":", 1)[1])


def test_relay_killed(scene: Scene) -> None:
    relay, address, zenoh = scene.stack.relay()
    _, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    screen = scene.screen(address)
    screen.says("LIVE")
    at_s = killed(relay)
    stale_s = screen.says("STALE", "no connection", at_s)
    scene.stack.relay(*ports(address, zenoh))
    serving_s = time.monotonic()
    back_s = screen.says("LIVE", since_s=at_s) - (serving_s - at_s)
    screen.watches(20, since_s=serving_s)
    screen.never_lied()
    scene.tell(STALE=stale_s, LIVE_again=back_s)


@pytest.mark.full
def test_relay_killed_before_a_hall(scene: Scene) -> None:
    """SIGKILL with three hundred viewers; the next relay is started at once: they return without help."""
    relay, address, zenoh = scene.stack.relay()
    _, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    hall = scene.hall(address, 300)
    hall.live()
    at_s = killed(relay)
    scene.stack.relay(*ports(address, zenoh))
    started_s = time.monotonic() - at_s
    back_s = hall.live(at_s)
    hall.never_lied()
    percentiles = quantiles(back_s, n=100)
    half_s, p95_s, p99_s = percentiles[49], percentiles[94], percentiles[98]
    scene.tell(next_relay_after=started_s, half=half_s, p95=p95_s, p99=p99_s, last=back_s[-1])


@pytest.mark.full
def test_relay_frozen(scene: Scene) -> None:
    relay, address, zenoh = scene.stack.relay()
    _, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    screen = scene.screen(address)
    screen.says("LIVE")
    at_s = signalled(relay, signal.SIGSTOP)
    stale_s = screen.says("STALE", "no connection", at_s)
    until("long enough for a dead socket to be noticed", lambda: screen.lines("closed", at_s) != [])
    thawed_s = signalled(relay, signal.SIGCONT)
    back_s = screen.says("LIVE", since_s=thawed_s)
    screen.watches(20, since_s=thawed_s)
    screen.never_lied()
    scene.tell(STALE=stale_s, LIVE_again=back_s)


@pytest.mark.full
def test_relay_redeployed_under_load(scene: Scene) -> None:
    """SIGTERM with a full hall: every viewer is moved away and returns to the next relay."""
    relay, address, zenoh = scene.stack.relay()
    _, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    screens = [scene.screen(address) for _ in range(10)]
    for screen in screens:
        screen.says("LIVE")
    at_s = signalled(relay, signal.SIGTERM)
    until("the old relay has ended", lambda: relay.process.poll() is not None)
    ended_s = time.monotonic() - at_s
    began_s = time.monotonic()
    scene.stack.relay(*ports(address, zenoh))
    back_s = [screen.says("LIVE", since_s=began_s, deadline_s=40) for screen in screens]
    codes = [screen.lines("closed", at_s)[0]["closed"] for screen in screens]
    assert relay.process.returncode == 0
    assert codes == [1012] * len(screens)
    for screen in screens:
        screen.never_lied()
    scene.tell(drained=ended_s, last_LIVE_again=max(back_s))


def test_router_in_the_path_killed(scene: Scene) -> None:
    _, address, zenoh = scene.stack.relay()
    listen = f"tcp/127.0.0.1:{free_port()}"

    middle = scene.router(listen, zenoh)
    _, fifo = scene.robot()
    scene.edge(listen, fifo)
    screen = scene.screen(address)
    screen.says("LIVE")
    at_s = killed(middle)
    offline_s = screen.says("OFFLINE", since_s=at_s)
    began_s = time.monotonic()
    scene.router(listen, zenoh)
    back_s = screen.says("LIVE", since_s=began_s)
    screen.watches(20, since_s=began_s)
    screen.never_lied()
    scene.tell(OFFLINE=offline_s, LIVE_again=back_s)
