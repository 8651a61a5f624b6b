"""The mirror's database becomes unreachable: no viewer of the relay notices."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from statistics import quantiles

import httpx
import pytest
from posecast_testing import until

from tests.faults.conftest import Scene, Screen
from tests.rtdb_double import Double

SCREENS = 5
BEFORE_S = 15.0
OUTAGE_S = 60.0


@pytest.fixture
def double() -> Iterator[Double]:
    """The database, or its double."""
    made = Double()
    yield made
    made.stop()


@pytest.mark.full
@pytest.mark.parametrize("fault", ["answers 503", "hangs"])
def test_mirrors_database_is_away_for_a_minute(scene: Scene, double: Double, fault: str) -> None:
    flags = ("--firebase-database", double.url, "--metrics-port", "0", "--log-level", "info")
    relay, address, zenoh = scene.stack.relay(flags=flags)
    metrics = until("metrics", lambda: re.search(r"metrics on (http://\S+/metrics)", relay.log))[1]

    def figure(name: str) -> float:
        text = httpx.get(metrics, trust_env=False).text
        return float(next(line for line in text.splitlines() if line.startswith(name)).rsplit(" ", 1)[1])

    _, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    screens = [scene.screen(address, hz=30) for _ in range(SCREENS)]
    for screen in screens:
        screen.says("LIVE")
    until("mirrored", lambda: (((double.node("demo") or {}).get("status") or {}).get("seq") or 0) > 30)

    began_s = time.monotonic()
    until("a while", lambda: time.monotonic() > began_s + BEFORE_S, BEFORE_S + 10)
    double.becomes(**({"hang": True} if fault == "hangs" else {"answer": 503}))
    away_s = time.monotonic()
    until("it is left alone", lambda: figure("posecast_mirror_breaker_open") == 1, 30.0)
    until("a minute", lambda: time.monotonic() > away_s + OUTAGE_S, OUTAGE_S + 10)
    back_s = time.monotonic()

    assert figure("posecast_skipped_frames_total") == 0
    assert figure('posecast_mirror_requests_total{result="failed"}') <= 12  # of 120
    seen = [
        {frame["seq"] for frame in screen.frames(began_s) if frame["at"] < back_s - 1} for screen in screens
    ]
    # of what all of them were there for: how late the last frame before a moment comes differs by screen
    first, last = max(min(one) for one in seen), min(max(one) for one in seen)
    assert last - first > 30 * OUTAGE_S
    of_all = {seq for seq in set.union(*seen) if first <= seq <= last}
    for one in seen:
        assert of_all - one == set()
    for screen in screens:
        screen.never_lied()
        assert screen.lines("word", began_s) == []
    with_it, without = p99_s(screens, began_s, away_s), p99_s(screens, away_s, back_s)
    scene.tell(p99_with_the_database=with_it, p99_without=without)


def p99_s(screens: list[Screen], from_s: float, to_s: float) -> float:
    """Of the frames' age compared with the least delayed one."""
    ages = [f["behind_s"] for screen in screens for f in screen.frames(from_s) if f["at"] < to_s]
    return float(quantiles(ages, n=100)[98])
