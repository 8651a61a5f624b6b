"""What workers count together: each sees what the others have, and nobody waits."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from posecast_relay.server.workers.shared_counts import (
    DOWN,
    PLACES,
    ROWS,
    SERVING,
    SharedCounts,
    open_shared_memory,
)

WORKERS = 3


@pytest.fixture
def workers() -> Iterator[list[SharedCounts]]:
    """As in so many processes."""
    memory = open_shared_memory(WORKERS)
    yield [SharedCounts(memory, WORKERS, number) for number in range(WORKERS)]
    os.close(memory)


def test_each_sees_the_others_and_not_itself(workers: list[SharedCounts]) -> None:
    one, two, three = workers
    one.add("viewers", 1)
    one.add("viewers", 1)
    two.add("viewers", 1)
    two.add("robot r", 1)
    assert [each.count_elsewhere("viewers") for each in workers] == [1, 2, 3]
    assert [each.count_elsewhere("robot r") for each in workers] == [1, 0, 1]
    one.add("viewers", -1)
    two.add("robot r", -1)
    assert three.count_elsewhere("viewers") == 2
    assert three.count_elsewhere("robot r") == 0


def test_a_worker_that_ended_counts_no_more(workers: list[SharedCounts]) -> None:
    one, two, _ = workers
    for each in workers:
        each.set_state(SERVING)
    two.add("viewers", 7)
    assert one.list_missing() == []
    one.clear(1)
    assert one.count_elsewhere("viewers") == 0
    assert one.list_missing() == [1]
    two.set_state(SERVING)
    two.set_state(DOWN)
    assert one.list_missing() == [1]


def test_more_names_than_places_are_counted_by_each_alone(workers: list[SharedCounts]) -> None:
    one, two, _ = workers
    names = [f"address 2001:db8::{number:x}" for number in range(2 * ROWS * PLACES)]
    for name in names:
        one.add(name, 1)
    seen = [name for name in names if two.count_elsewhere(name) == 1]
    assert ROWS * PLACES * 0.8 < len(seen) <= ROWS * PLACES
    for name in names:
        one.add(name, -1)
    assert not any(two.count_elsewhere(name) for name in names)
    one.add("viewers", 1)  # there is room again
    assert two.count_elsewhere("viewers") == 1


def test_a_place_that_is_free_is_taken_by_another_name(workers: list[SharedCounts]) -> None:
    one, two, _ = workers
    for number in range(20 * ROWS * PLACES):
        one.add(f"address {number}", 1)
        one.add(f"address {number}", -1)
    one.add("robot r", 2)
    assert two.count_elsewhere("robot r") == 2
