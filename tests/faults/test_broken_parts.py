"""Proves that the suite would notice: each scenario fails against a component that breaks what the scenario
tests."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from posecast_testing import until

from tests.faults import test_edge as edge
from tests.faults import test_truth as truth
from tests.faults import test_viewers as viewers
from tests.faults.conftest import Scene
from tests.faults.truth import HOLDING_S

pytestmark = pytest.mark.full
HERE = Path(__file__).parent


def whatever_is_claimed_is_so(scene: Scene) -> None:
    """Checks only the claims; other tests check which words are used."""
    _, address, zenoh = scene.stack.relay()
    _, fifo = scene.robot()
    scene.edge(zenoh, fifo)
    screen = scene.screen(address, hz=30)
    screen.says("LIVE")
    began_s = time.monotonic()
    until("longer than any claim lasts", lambda: time.monotonic() > began_s + 2 * HOLDING_S)
    screen.never_lied()


def fails(scene: Scene, scenario: Callable[[Scene], None], complaint: str) -> None:
    with pytest.raises(AssertionError, match=complaint) as failed:
        scenario(scene)
    scene.tell(str(failed.value).partition("\n")[0])


@pytest.mark.parametrize(
    ("way", "scenario", "complaint"),
    [
        ("backpressure", viewers.test_a_viewer_that_reads_again, "old frames were handed over"),
        ("fifo", viewers.test_a_viewer_that_reads_again, "old frames were handed over"),
        ("runs", edge.test_two_edges_claim_one_robot, "changes of edge"),
        ("drops", truth.test_a_robot_that_moves_is_live, "'STALE'"),
        ("repeats", truth.test_a_robot_that_moves_is_live, "'HOLDING'"),
        ("repeats", whatever_is_claimed_is_so, "HOLDING with an old pose"),
        ("late", whatever_is_claimed_is_so, "LIVE with an old pose"),
    ],
    ids=[
        "no backpressure",
        "FIFO instead of mailbox",
        "unchecked runs",
        "frames dropped while the robot counts as heard",
        "an old pose as the newest: not LIVE",
        "an old pose as the newest: a HOLDING that lies",
        "old frames as fresh: a LIVE that lies",
    ],
)
def test_a_broken_relay_is_noticed(
    scene: Scene, way: str, scenario: Callable[[Scene], None], complaint: str
) -> None:
    scene.stack.relay_command = (sys.executable, str(HERE / "broken_relay.py"), way)
    fails(scene, scenario, complaint)


@pytest.mark.parametrize(
    ("way", "complaint"),
    [("sticks", "HOLDING with an old pose"), ("late", "LIVE with an old pose")],
    ids=["codes that stick: a HOLDING that lies", "old samples as fresh: a LIVE that lies"],
)
def test_a_broken_edge_is_noticed(scene: Scene, way: str, complaint: str) -> None:
    scene.stack.edge_command = (sys.executable, str(HERE / "broken_edge.py"), way)
    fails(scene, whatever_is_claimed_is_so, complaint)
