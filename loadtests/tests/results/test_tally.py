import pytest
from posecast_loadtests.results.tally import LoadLimits, Tally, breaches, report


def full(viewers: int = 3) -> Tally:
    tally = Tally()
    for late_ms in range(1, 101):
        tally.frame(late_ms / 1000)
    for _ in range(viewers):
        tally.viewer(10.0)
    return tally


def test_percentiles_are_off_by_a_bucket_at_most() -> None:
    tally = full()
    assert tally.percentile_ms(0.5) == pytest.approx(50, rel=0.13)
    assert tally.percentile_ms(0.99) == pytest.approx(99, rel=0.13)
    tally.frame(1e6)
    assert tally.percentile_ms(1.0) == float("inf")
    assert Tally().percentile_ms(0.99) == 0.0


def test_fairness() -> None:
    assert full().jain == pytest.approx(1.0)
    unfair = Tally()
    unfair.viewer(10.0)
    unfair.viewer(0.0)
    assert unfair.jain == pytest.approx(0.5)


def test_processes_add_up() -> None:
    whole = Tally.sum([full(3).counts(), full(5).counts()])
    assert (whole.viewers, whole.frames, sum(whole.buckets)) == (8, 200, 200)
    assert whole.jain == pytest.approx(1.0)


def test_the_verdict_names_every_breach() -> None:
    assert breaches(full(), LoadLimits()) == []
    assert "all limits kept" in report(full(), LoadLimits())
    bad = full()
    bad.duplicates, bad.missed, bad.undecodable = 2, 100, 1
    text = "\n".join(breaches(bad, LoadLimits(p99_ms=50)))
    for part in ("2 duplicates", "1 undecodable", "missed 50.00%", "p99 lateness"):
        assert part in text
    assert breaches(Tally(), LoadLimits()) == ["no viewer got a frame"]
