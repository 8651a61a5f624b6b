"""One word for every viewer."""

from __future__ import annotations

import pytest
from posecast_relay.core.robot import Liveness


@pytest.mark.parametrize(
    ("token", "age_s", "word"),
    [
        (True, 0.1, "online"),
        (True, 1.5, "online"),
        (True, 1.6, "silent"),
        (True, None, "silent"),
        (False, None, "offline"),
        (False, 0.1, "offline"),
    ],
)
def test_token_and_age(token: bool, age_s: float | None, word: str) -> None:
    liveness = Liveness()
    liveness.set_token()
    if not token:
        liveness.clear_token(100.0)
    live_at = None if age_s is None else 99.9
    assert liveness.compute_status(live_at, age_s, 1.5) == word


def test_frames_long_after_the_token_left_come_from_another_edge_with_this_id() -> None:
    liveness = Liveness()
    liveness.set_token()
    liveness.clear_token(100.0)
    assert liveness.compute_status(100.5, 0.1, 1.5) == "offline"  # was on its way
    assert liveness.compute_status(101.5, 0.1, 1.5) == "online"
    assert liveness.compute_status(101.5, 3.0, 1.5) == "offline"
