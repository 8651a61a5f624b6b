from __future__ import annotations

from posecast_edge.kit import TokenBucket


def test_so_many_at_once_and_then_so_many_a_second() -> None:
    allowance = TokenBucket(per_s=10.0, most=20.0)
    assert sum(allowance.take(0.0) for _ in range(10_000)) == 20
    assert sum(allowance.take(i / 1024) for i in range(1, 10_241)) == 100
    assert sum(allowance.take(1e6) for _ in range(100)) == 20, "it does not fill without end"


def test_what_costs_more_than_there_can_be_waits_for_all() -> None:
    allowance = TokenBucket(per_s=1.0, most=4.0)
    assert allowance.take(0.0, 10.0)
    assert allowance.compute_wait_s(1.0, 10.0) == 9.0
    assert not allowance.take(9.0, 10.0)
    assert allowance.take(10.0, 10.0)
