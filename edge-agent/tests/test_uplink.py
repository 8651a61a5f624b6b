"""A robot on a mobile uplink of 32 kbit/s, which carries a third of what it would send: it sends less."""

from __future__ import annotations

import itertools
import json
import math
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from edge_stage import ROBOT
from posecast_testing import until

pytestmark = [
    pytest.mark.full,
    pytest.mark.skipif(
        os.geteuid() != 0 or not shutil.which("tc") or not shutil.which("ip"), reason="needs root, ip and tc"
    ),
]
NAMES = [f"joint{i}" for i in range(40)]
RUN_S = 45.0
OLDEST_S = 3.0


def ip(*command: str) -> None:
    subprocess.run(["ip", *command], check=True, capture_output=True)


@pytest.fixture
def uplink() -> Iterator[Callable[..., list[str]]]:
    """Two namespaces and a wire of 32 kbit/s from the first to the second; returns how to run inside one."""
    tag = f"{os.getpid() % 10000}"
    lab, net = f"pclab{tag}", f"pcnet{tag}"
    try:
        for name in (lab, net):
            ip("netns", "add", name)
            ip("-n", name, "link", "set", "lo", "up")
        ip("link", "add", f"pa{tag}", "netns", lab, "type", "veth", "peer", "name", f"pb{tag}", "netns", net)
        for name, device, address in ((lab, f"pa{tag}", "10.99.7.1/24"), (net, f"pb{tag}", "10.99.7.2/24")):
            ip("-n", name, "addr", "add", address, "dev", device)
            ip("-n", name, "link", "set", device, "up")
        rate = ("rate", "32kbit", "burst", "1600", "latency", "2000ms")
        ip("netns", "exec", lab, "tc", "qdisc", "add", "dev", f"pa{tag}", "root", "tbf", *rate)
        yield lambda where: ["ip", "netns", "exec", {"lab": lab, "net": net}[where]]
    finally:
        for name in (lab, net):
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True)


def test_the_pose_at_the_relay_is_never_older_than_three_seconds(uplink: Callable[..., list[str]]) -> None:
    router = subprocess.Popen(
        [*uplink("net"), sys.executable, str(Path(__file__).with_name("uplink_router.py")), "10.99.7.2"],
        stdout=subprocess.PIPE,
        text=True,
    )
    arrived: list[tuple[float, float, int]] = []
    said: list[str] = []
    stop = threading.Event()
    edge: subprocess.Popen[str] | None = None
    try:
        assert router.stdout is not None
        endpoint = router.stdout.readline().strip()
        lines = router.stdout

        def listen() -> None:
            for line in lines:
                at, t, size = line.split()
                arrived.append((float(at), float(t), int(size)))

        threading.Thread(target=listen, daemon=True).start()
        edge = subprocess.Popen(
            [
                *uplink("lab"),
                *(sys.executable, "-m", "posecast_edge", "run", "--robot", ROBOT, "--source", "jsonl"),
                *("--relay", endpoint),
            ],
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert edge.stdin is not None
        assert edge.stderr is not None
        told = edge.stderr
        threading.Thread(target=lambda: said.extend(told), daemon=True).start()
        pipe = edge.stdin

        def feed() -> None:
            # every joint moves by hundreds of steps from frame to frame: nothing compresses it away
            for k in itertools.count():
                if stop.wait(1 / 60):
                    return
                turns = [k * (0.3 + i / 50) for i in range(len(NAMES))]
                values = {
                    field: {n: math.sin(f * turn) for n, turn in zip(NAMES, turns, strict=True)}
                    for f, field in enumerate(("pos", "cur", "volts", "load"), start=1)
                }
                try:
                    pipe.write(json.dumps({"t": time.monotonic(), **values}) + "\n")
                    pipe.flush()
                except OSError:
                    return

        threading.Thread(target=feed, daemon=True).start()
        until("the first frame", lambda: len(arrived) > 0, 30)
        began_s = time.monotonic()
        until("the run", lambda: time.monotonic() - began_s > RUN_S, RUN_S + 10)
        stop.set()
    finally:
        for process in (edge, router):
            if process is not None:
                process.kill()
                process.wait()
    # just before a frame arrives the newest pose is that of the one before
    ages = [b[0] - a[1] for a, b in itertools.pairwise(arrived)]
    worst = max(range(len(ages)), key=ages.__getitem__)
    shown = (
        f"{len(arrived)} frames of {arrived[-1][2]} B, the oldest pose {max(ages):.2f} s "
        f"after {arrived[worst][0] - arrived[0][0]:.1f} s, said {said[-3:]}"
    )
    assert max(ages) <= OLDEST_S, shown
    assert [line for line in said if "Hz instead of 30" in line], shown
    assert arrived[-1][2] * 8 * 30 > 32_000, "the test means nothing when all frames fit"
    print(shown)
