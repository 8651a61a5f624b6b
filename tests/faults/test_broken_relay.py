"""The suite would notice: each scenario fails against a relay that lacks what the scenario is about."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.faults import test_edge as edge
from tests.faults import test_viewers as viewers
from tests.faults.conftest import TOLD, Scene

pytestmark = pytest.mark.full
BROKEN_RELAY = Path(__file__).with_name("broken_relay.py")


@pytest.mark.parametrize(
    ("way", "scenario", "complaint"),
    [
        ("backpressure", viewers.test_a_viewer_that_reads_again, "old frames were handed over"),
        ("fifo", viewers.test_a_viewer_that_reads_again, "old frames were handed over"),
        ("runs", edge.test_two_edges_claim_one_robot, "changes of edge"),
    ],
    ids=["no backpressure", "FIFO instead of mailbox", "unchecked runs"],
)
def test_a_broken_relay_is_noticed(
    scene: Scene, way: str, scenario: Callable[[Scene], None], complaint: str
) -> None:
    scene.stack.relay_command = (sys.executable, str(BROKEN_RELAY), way)
    with pytest.raises(AssertionError, match=complaint) as failed:
        scenario(scene)
    TOLD.append((scene.name, str(failed.value).partition("\n")[0]))
