"""Faults on the viewers' side."""

from __future__ import annotations

import json
import signal
import sys
import time
import urllib.request
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from posecast_loadtests.connection import Connection
from posecast_loadtests.results import Clock, Tally, Viewer
from posecast_testing import until
from websockets.frames import Opcode

from tests.conftest import Stack
from tests.faults.conftest import Scene
from tests.namespaces import FAR, NEAR, Cable

pytestmark = pytest.mark.full
LATE_LINK = Path(__file__).with_name("late_link.py")
PAUSE_S = 7.0  # long past the 2 s of frames that may be under way, and not yet cut


def watching(address: str) -> int:
    with urllib.request.urlopen(f"http://{address}/api/v1/robots/demo", timeout=5) as answer:
        return int(json.load(answer)["viewers"])


@pytest.fixture
def cable() -> Iterator[Cable]:
    """Relay and robot are near, a viewer is far."""
    made = Cable()
    yield made
    made.close()


def far_relay(cable: Cable, scene: Scene, stack: Stack) -> str:
    """A relay near the demo robot; its address for distant viewers."""
    _, address, zenoh = cable.near.run(lambda: stack.relay(flags=("--host", NEAR)))
    _, fifo = scene.robot()
    cable.near.run(lambda: scene.edge(zenoh, fifo))
    return address


def test_a_frozen_viewer_is_cut_and_hurts_nobody(scene: Scene) -> None:
    _, address, zenoh = scene.stack.relay()
    _, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    frozen, other = scene.screen(address), scene.screen(address)
    for screen in (frozen, other):
        screen.says("LIVE")
    at_s = frozen.signal(signal.SIGSTOP)
    until("it is cut", lambda: watching(address) == 1, 25)
    cut_s = time.monotonic() - at_s
    newest = frozen.frames()[-1]["seq"]
    thawed_s = frozen.signal(signal.SIGCONT)
    frozen.says("LIVE", since_s=thawed_s)
    frozen.watches(10, since_s=thawed_s + 2)
    # of what was sent before the freeze it gets two seconds' worth at most, then the newest
    late = [f for f in frozen.frames(thawed_s) if f["seq"] <= newest + 2 * 30 + 3 * 10]
    assert len(late) <= 2 * 10 + 10
    assert {line["word"] for line in other.lines("word", at_s)} == set()
    for screen in (frozen, other):
        screen.never_lied()
    scene.tell(cut_after=cut_s)


def passed(since_s: float, seconds: float) -> bool:
    return time.monotonic() - since_s > seconds


def made_before_a_pause_ended(address: str, pause_s: float) -> list[float]:
    """What a viewer that stops reading for this long receives in 4 s afterwards.

    For each frame, how long before the viewer read again it was made, s; negative: after that.
    """
    link = Connection(f"ws://{address}/api/v1/robots/demo/live?hz=10")
    viewer = Viewer(Tally(), Clock(), step=3, decode=True)
    before_s: list[float] = []
    resumed_s = float("inf")
    for opcode, payload, arrival_s in link.messages():
        if opcode is Opcode.TEXT and json.loads(payload)["type"] == "schema":
            viewer.schema(payload.decode())
        elif opcode is Opcode.BINARY:
            lateness_s = viewer.binary(payload, arrival_s)
            if arrival_s > resumed_s and lateness_s is not None:
                before_s.append(resumed_s - (arrival_s - lateness_s))
        if viewer.frames == 20 and resumed_s == float("inf"):
            began_s = time.monotonic()
            until("a while", partial(passed, began_s, pause_s))
            resumed_s = time.monotonic()
        if arrival_s > resumed_s + 4:
            break
    link.close()
    return before_s


def test_a_viewer_that_reads_again(scene: Scene) -> None:
    """Before it is disconnected. It gets what was in transit when it stopped, then the newest, nothing in
    between."""
    _, address, zenoh = scene.stack.relay()
    _, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    scene.screen(address).says("LIVE")
    before_s = made_before_a_pause_ended(address, PAUSE_S)
    old = sum(before > 1.0 for before in before_s)
    assert old <= 2 * 10 + 5, f"{old} old frames were handed over, 2 s of them were due at most"
    assert len(before_s) - old >= 10
    scene.tell(old_frames_handed_over=old / 10)


def test_half_open_viewer(scene: Scene, stack: Stack, cable: Cable) -> None:
    address = far_relay(cable, scene, stack)
    screen = scene.screen(address, namespace=cable.far)
    screen.says("LIVE")
    at_s = time.monotonic()
    cable.near.do("ip link set cable down")
    stale_s = screen.says("STALE", "no connection", at_s)
    until("the relay has noticed", lambda: cable.near.run(lambda: watching(address)) == 0)
    gone_s = time.monotonic() - at_s
    mended_s = time.monotonic()
    cable.near.do("ip link set cable up")
    back_s = screen.says("LIVE", since_s=mended_s)
    screen.watches(20, since_s=mended_s)
    screen.never_lied()
    scene.tell(STALE=stale_s, noticed_by_the_relay=gone_s, LIVE_again=back_s)


def test_one_kilobyte_a_second(scene: Scene, stack: Stack, cable: Cable) -> None:
    """Far less than 30 Hz needs: it gets fewer frames, each as new as the link allows."""
    address = far_relay(cable, scene, stack)
    cable.near.do("tc qdisc add dev cable root tbf rate 8kbit burst 1540 latency 2000ms")
    screen = scene.screen(address, hz=30, namespace=cable.far)
    screen.says("LIVE", deadline_s=60)
    began_s = time.monotonic()
    screen.watches(40, since_s=began_s, deadline_s=120)
    frames = screen.frames(began_s)
    screen.never_lied()
    worst_s = max(frame["behind_s"] for frame in frames)
    scene.tell(oldest_frame=worst_s)


def test_a_tenth_of_the_packets_lost(scene: Scene, stack: Stack, cable: Cable) -> None:
    address = far_relay(cable, scene, stack)
    try:
        cable.near.do(
            "nft add table inet faults",
            "nft add chain inet faults out { type filter hook output priority 0 ; }",
            f"nft add rule inet faults out ip daddr {FAR} numgen random mod 100 < 10 drop",
        )
    except FileNotFoundError:
        pytest.skip("nft is needed (nftables)")
    screen = scene.screen(address, namespace=cable.far)
    screen.says("LIVE")
    began_s = time.monotonic()
    screen.watches(120, since_s=began_s, deadline_s=120)
    frames = screen.frames(began_s)
    screen.never_lied()
    worst_s = max(frame["behind_s"] for frame in frames)
    scene.tell(oldest_frame=worst_s)


def test_far_away(scene: Scene, stack: Stack) -> None:
    """150 ms each way, plus or minus 50: LIVE, every frame in order, hardly later than the link's delay."""
    _, address, zenoh = stack.relay()
    _, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    link = scene.stack.start("link", sys.executable, str(LATE_LINK), address, "150", "50")
    port = link.line(r"PORT (\d+)")[1]
    screen = scene.screen(f"127.0.0.1:{port}")
    screen.says("LIVE")
    began_s = time.monotonic()
    screen.watches(100, since_s=began_s)
    frames = screen.frames(began_s)
    screen.never_lied()
    assert {line["word"] for line in screen.lines("word", began_s)} <= {"LIVE"}
    assert [line["closed"] for line in screen.lines("closed")] == []
    worst_s = max(frame["behind_s"] for frame in frames)
    scene.tell(oldest_frame=worst_s)
