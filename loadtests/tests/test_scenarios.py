from posecast_loadtests.scenarios import SCENARIOS, Scenario, Stage


def test_kinds_are_spread_evenly() -> None:
    phones = SCENARIOS["slow-phones"]
    kinds = [phones.kind(number) for number in range(phones.viewers)]
    assert [kinds.count(kind) for kind in ("frozen", "slow", "healthy")] == [25, 100, 375]
    assert kinds[:20].count("frozen") == 1
    assert kinds[:20].count("slow") in (3, 4)
    assert {SCENARIOS["lecture"].kind(number) for number in range(100)} == {"healthy"}


def test_stretching_keeps_the_shape() -> None:
    long = SCENARIOS["lecture"].stretched(10, 50)
    assert (long.viewers, long.seconds) == (50, 10 * SCENARIOS["lecture"].seconds)
    assert [s.share for s in long.stages] == [s.share for s in SCENARIOS["lecture"].stages]
    assert long.churn_per_min == SCENARIOS["lecture"].churn_per_min


def test_a_scenario_of_its_own() -> None:
    plain = Scenario("viewers", "viewers", 5, (Stage(0, 1.0),))
    assert plain.kind(3) == "healthy"
