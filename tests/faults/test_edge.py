"""Faults on the robot's side."""

from __future__ import annotations

import json
import os
import signal
import time
import urllib.request
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from posecast_testing import until

from tests.conftest import Stack
from tests.faults.conftest import Scene, killed, signalled, told
from tests.namespaces import FAR, Cable

AWAY_S = 60 * float(os.environ.get("POSECAST_AWAY_MINUTES", "0.17"))  # R12 asks for 60
RELAY_HOST = "127.0.0.5"  # with --dev the relay's Zenoh stays on loopback; a cable lends it


def resident_kb(pid: int) -> int:
    """RSS (proc(5))."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") // 1024


def test_edge_killed(scene: Scene) -> None:
    _, address, zenoh = scene.stack.relay()
    _, fifo = scene.robot()
    edge, screen = scene.edge(zenoh, fifo), scene.screen(address)
    screen.says("LIVE")
    at_s = killed(edge)
    offline_s = screen.says("OFFLINE", since_s=at_s)
    began_s = time.monotonic()
    scene.edge(zenoh, fifo)
    back_s = screen.says("LIVE", since_s=began_s)
    screen.watches(20, since_s=began_s)
    screen.never_lied()
    scene.tell(OFFLINE=offline_s, LIVE_again=back_s)


@pytest.mark.full
def test_edge_frozen(scene: Scene) -> None:
    _, address, zenoh = scene.stack.relay()
    _, fifo = scene.robot()
    edge, screen = scene.edge(zenoh, fifo), scene.screen(address)
    screen.says("LIVE")
    at_s = signalled(edge, signal.SIGSTOP)
    stale_s = screen.says("STALE", "robot silent", at_s)
    offline_s = screen.says("OFFLINE", since_s=at_s)
    thawed_s = signalled(edge, signal.SIGCONT)
    back_s = screen.says("LIVE", since_s=thawed_s)
    assert [line["word"] for line in screen.lines("word", at_s)][:2] == ["STALE", "OFFLINE"]
    screen.watches(20, since_s=thawed_s)
    screen.never_lied()
    scene.tell(STALE=stale_s, OFFLINE=offline_s, LIVE_again=back_s)


def test_source_silent(scene: Scene) -> None:
    _, address, zenoh = scene.stack.relay()
    robot, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    screen = scene.screen(address)
    screen.says("LIVE")
    at_s = signalled(robot, signal.SIGSTOP)
    stale_s = screen.says("STALE", "robot silent", at_s)
    went_on_s = signalled(robot, signal.SIGCONT)
    back_s = screen.says("LIVE", since_s=went_on_s)
    screen.watches(20, since_s=went_on_s)
    assert screen.lines("word", at_s)[0]["word"] == "STALE"
    screen.never_lied()
    scene.tell(STALE=stale_s, LIVE_again=back_s)


@pytest.mark.parametrize("step_s", [-3600, 86_400])
def test_robots_clock_jumps(scene: Scene, step_s: int) -> None:
    _, address, zenoh = scene.stack.relay()
    robot, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    screen = scene.screen(address, hz=30)
    screen.says("LIVE")
    screen.watches(10)
    at_s, t_s = time.monotonic(), screen.frames()[-1]["t"]
    told(robot, f"step {step_s}")
    until("frames on the new clock", lambda: abs(screen.frames()[-1]["t"] - t_s - step_s) < 60)
    screen.watches(20, since_s=time.monotonic())
    assert {line["word"] for line in screen.lines("word", at_s)} <= {"LIVE"}
    screen.never_lied()
    frames = screen.frames(at_s)
    scene.tell(longest_gap=max(b["at"] - a["at"] for a, b in pairwise(frames)))


@pytest.fixture
def cable() -> Iterator[Cable]:
    """The robot is far, relay and viewers are near."""
    made = Cable()
    made.lend(RELAY_HOST)
    yield made
    made.close()


Cut = Callable[[Cable], Callable[[], None]]


def unplug(cable: Cable) -> Callable[[], None]:
    """Takes the robot's own interface down; returns a function that restores it."""
    cable.far.do("ip link set plug down")
    return lambda: cable.far.do("ip link set plug up", f"ip route add {RELAY_HOST}/32 dev plug src {FAR}")


def swallow(cable: Cable) -> Callable[[], None]:
    """Every packet vanishes somewhere on the path, as on a lost radio link; returns a function that ends
    that."""
    try:
        cable.near.do(
            "nft add table inet cut",
            "nft add chain inet cut in { type filter hook input priority 0 ; }",
            "nft add chain inet cut out { type filter hook output priority 0 ; }",
            f"nft add rule inet cut in ip saddr {FAR} drop",
            f"nft add rule inet cut out ip daddr {FAR} drop",
        )
    except FileNotFoundError:
        pytest.skip("nft is needed (nftables)")
    return lambda: cable.near.do("nft delete table inet cut")


@pytest.mark.full
@pytest.mark.parametrize("cut", [unplug, swallow], ids=["unplugged", "swallowed on the way"])
def test_uplink_away(
    scene: Scene, stack: Stack, cable: Cable, cut: Callable[[Cable], Callable[[], None]]
) -> None:
    """Both directions go silent without notice, for AWAY_S. The robot and its agent continue."""
    _, address, zenoh = cable.near.run(lambda: stack.relay(zenoh_host=RELAY_HOST))
    _, fifo = scene.robot()
    edge = cable.far.run(lambda: scene.edge(zenoh, fifo))
    screen = scene.screen(address, namespace=cable.near)
    screen.says("LIVE")
    screen.watches(20)
    began_s, before_kb = time.monotonic(), resident_kb(edge.process.pid)
    mend = cut(cable)
    cut_s = time.monotonic()
    stale_s, offline_s = screen.says("STALE", since_s=began_s), screen.says("OFFLINE", since_s=began_s)
    newest = [f for f in screen.frames() if f["at"] < began_s + stale_s][-1]

    most_kb = before_kb
    while time.monotonic() - cut_s < AWAY_S:
        most_kb = max(most_kb, resident_kb(edge.process.pid))
        time.sleep(0.2)
    assert {line["word"] for line in screen.lines("word", began_s)} == {"STALE", "OFFLINE"}
    mended_s = time.monotonic()
    mend()
    back_s = screen.says("LIVE", since_s=mended_s)
    screen.watches(100, since_s=mended_s)
    most_kb = max(most_kb, resident_kb(edge.process.pid))

    after = screen.frames(mended_s)
    of_then = [f for f in after if f["t"] - newest["t"] < AWAY_S - 1]
    assert of_then == [], "frames of the dead time came after all"
    assert most_kb - before_kb <= 5 * 1024
    screen.never_lied()
    scene.tell(
        f"away for {AWAY_S / 60:.3g} min, edge at most {(most_kb - before_kb) / 1024:+.1f} MB",
        STALE_after_the_last_frame=began_s + stale_s - newest["at"],
        OFFLINE=offline_s,
        LIVE_again=back_s,
    )


@pytest.mark.full
def test_two_edges_claim_one_robot(scene: Scene) -> None:
    """The newest agent wins and keeps the name; no viewer's picture flaps."""
    _, address, zenoh = scene.stack.relay()
    _, first = scene.robot("RKN,LKN")
    _, second = scene.robot("RKN,LKN,WST")
    scene.edge(zenoh, first)
    screen = scene.screen(address)
    screen.says("LIVE")
    at_s = time.monotonic()
    scene.edge(zenoh, second)
    until("the second is shown", lambda: len({f["schema"] for f in screen.frames(at_s)}) == 2)
    screen.watches(60, since_s=time.monotonic())  # longer than from one KEY to the next
    shown = [f["schema"] for f in screen.frames(at_s)]
    changes = sum(a != b for a, b in pairwise(shown))
    assert changes == 1, f"{changes} changes of edge, one was due"
    with urllib.request.urlopen(f"http://{address}/api/v1/robots/demo", timeout=5) as answer:
        assert json.load(answer)["conflict"] is True
    screen.never_lied()


def test_schema_changed(scene: Scene) -> None:
    """The edge returns with other joints; viewers continue without action."""
    _, address, zenoh = scene.stack.relay()
    _, first = scene.robot("RKN,LKN")
    edge = scene.edge(zenoh, first)
    screen = scene.screen(address)
    screen.says("LIVE")
    edge.stop()
    _, second = scene.robot("RKN,LKN,WST,NKY")
    at_s = time.monotonic()
    scene.edge(zenoh, second)
    until("the new schema is shown", lambda: len({f["schema"] for f in screen.frames()}) == 2)
    back_s = screen.says("LIVE", since_s=at_s)
    screen.watches(20, since_s=at_s)
    assert [line["closed"] for line in screen.lines("closed")] == []
    screen.never_lied()
    scene.tell(LIVE_again=back_s)
