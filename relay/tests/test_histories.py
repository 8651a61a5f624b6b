"""Histories of edges, ingests, gateways, Redis and clocks, on a clock that is simulated.

Whatever happened: two seconds after quiet has returned every robot that sends is LIVE at every gateway; no
old pose is ever shown as live; no frame twice or out of order. Those that once failed: `kept_histories`.
"""

from __future__ import annotations

from itertools import groupby

import pytest
from hypothesis import Phase, note, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule
from posecast_testing import count_examples

from .histories import BACK_S, RETURN_S, ROBOTS, History, Step
from .kept_histories import KEPT

PARTS = ("generation", "writer", "status", "public:state")
BOARD = ("robots", "viewers", "ingests")
KEYS = [*(f"posecast:{{a}}:{part}" for part in PARTS), *(f"posecast:{{-}}:{part}" for part in BOARD), "*"]

numbers = st.integers(0, 3)
reaches = st.sampled_from([(0,), (1,), (0, 1)])
keys = st.sampled_from(KEYS + [f"posecast:{{b}}:{part}" for part in PARTS])


def played(*steps: Step, back_s: float = BACK_S) -> History:
    """A whole history; quiet must be back so soon."""
    history = History()
    try:
        history.play(*steps)
        history.back_s = back_s
        history.quiet()
    finally:
        history.end()
    return history


ON_AIR: list[Step] = [("ingest",), ("gateway",), ("edge", "a", 0), ("wait", 2.0)]


@pytest.mark.parametrize("restarted", ["nobody", "edge", "ingest"])
@pytest.mark.parametrize("harm", ["lose", "spoil"])
@pytest.mark.parametrize("key", KEYS)
def test_a_key_that_is_lost_or_of_another_type_mutes_nobody(key: str, harm: str, restarted: str) -> None:
    """Quiet begins when it is lost, or when what was away then is there again."""
    again: list[Step] = [("stop", 0, False), ("wait", 0.5), ("edge", "a", 0)]
    around: dict[str, tuple[list[Step], list[Step]]] = {
        "nobody": ([], []),
        "edge": ([*again, ("wait", 1.0), ("stop", 0, False)], [("edge", "a", 0)]),
        "ingest": ([*again, ("wait", 1.0), ("kill_ingest", 0), ("wait", 1.0)], [("ingest",)]),
    }
    before, after = around[restarted]
    played(*ON_AIR, *before, ("redis_does", harm, key), *after)


@pytest.mark.parametrize("away_s", [0.3, 2.5, 10.0])
def test_redis_emptied_while_no_ingest_runs(away_s: float) -> None:
    """Gateways remember the generations that Redis has forgotten."""
    times: list[Step] = [("kill_ingest", 0), ("ingest",), ("wait", 0.5)] * 4
    played(*ON_AIR, *times, ("kill_ingest", 0), ("redis_does", "lose", "*"), ("wait", away_s), ("ingest",))


@pytest.mark.parametrize(
    "what", [("redis_is", "locked", True), ("redis_is", "readonly", True), ("redis_is", "loading", True),
             ("redis_is", "frozen", True), ("redis_is", "delay_s", 0.2), ("redis_is", "evicting", True),
             ("redis_does", "kill"), ("redis_does", "cut"), ("redis_does", "cut_subscribers")],
    ids=lambda step: "-".join(map(str, step)),
)  # fmt: skip
@pytest.mark.parametrize("for_s", [0.2, 1.2, 5.0])
def test_redis_that_is_out_of_order_for_a_while(what: Step, for_s: float) -> None:
    played(*ON_AIR, what, ("wait", for_s))


@pytest.mark.parametrize("killed", [False, True], ids=["stopped", "killed"])
@pytest.mark.parametrize("first", [(0,), (1,), (0, 1)], ids=str)
@pytest.mark.parametrize("second", [(0,), (1,), (0, 1)], ids=str)
def test_a_run_comes_back_when_the_newer_one_has_ended(
    killed: bool, first: tuple[int, ...], second: tuple[int, ...]
) -> None:
    """Whichever of two ingests hear the two edges."""
    start: list[Step] = [("ingest",), ("ingest",), ("gateway",), ("edge", "a", *first), ("wait", 3.0)]
    history = played(*start, ("edge", "a", *second), ("wait", 3.0), ("stop", 1, killed), back_s=RETURN_S)
    for page in history.pages:
        if page.robot == "a":
            runs = [run_id for run_id, _ in groupby(page.poses, lambda pose: pose[0])]
            assert (runs[0], len(set(runs))) == (runs[-1], 2), runs


def test_a_second_ingest_writes_on_when_the_first_is_killed() -> None:
    for n in (0, 1):
        played(("ingest",), *ON_AIR[:2], ("edge", "a", 0, 1), ("wait", 2.0), ("ingest",), ("kill_ingest", n))


@pytest.mark.parametrize("name", KEPT)
def test_a_history_that_once_failed(name: str) -> None:
    history = History()
    try:
        history.play(*KEPT[name])
        history.quiet()
    finally:
        history.end()


class Histories(RuleBasedStateMachine):
    """Steps in any order, and quiet now and then."""

    def __init__(self) -> None:
        super().__init__()
        self.history = History()

    def teardown(self) -> None:
        """Every history ends in quiet."""
        note(f"as it may be kept: {self.history.steps}")
        try:
            self.history.quiet()
        finally:
            self.history.end()

    @initialize(ingests=st.integers(1, 2))
    def begin(self, ingests: int) -> None:
        """A robot on air."""
        self.history.play(*[("ingest",)] * ingests, ("gateway",), ("edge", "a", 0, 1), ("wait", 1.0))

    @rule(seconds=st.sampled_from([0.05, 0.3, 0.7, 1.2, 2.5, 4.0]))
    def wait(self, seconds: float) -> None:
        """Nothing."""
        self.history.play(("wait", seconds))

    @rule(robot=st.sampled_from(ROBOTS), ingests=reaches)
    def edge(self, robot: str, ingests: tuple[int, ...]) -> None:
        """One more."""
        self.history.play(("edge", robot, *ingests))

    @rule(n=numbers, killed=st.booleans())
    def stop(self, n: int, killed: bool) -> None:
        """An edge ends."""
        self.history.play(("stop", n, killed))

    @rule(n=numbers, killed=st.booleans(), ingests=reaches)
    def restart(self, n: int, killed: bool, ingests: tuple[int, ...]) -> None:
        """An edge begins a new run."""
        edges = self.history.fleet.edges
        if n < len(edges):
            self.history.play(("stop", n, killed), ("edge", edges[n].robot, *ingests))

    @rule(n=numbers, sends=st.booleans())
    def silence(self, n: int, sends: bool) -> None:
        """A source stands still, or goes on."""
        self.history.play(("silence", n, sends))

    @rule(n=numbers, ingest=st.integers(0, 1), connected=st.booleans())
    def link(self, n: int, ingest: int, connected: bool) -> None:
        """Between an edge and an ingest."""
        self.history.play(("link", n, ingest, connected))

    @rule(n=numbers, rate=st.sampled_from([0.0, 1.0, 1.0001, 0.9999]))
    def clock(self, n: int, rate: float) -> None:
        """Of an edge: it stands still, runs, drifts."""
        self.history.play(("clock", n, rate))

    @rule(what=st.sampled_from(["ingest", "gateway"]))
    def start(self, what: str) -> None:
        """One more."""
        self.history.play((what,))

    @rule(what=st.sampled_from(["kill_ingest", "kill_gateway", "watch"]), n=st.integers(0, 1))
    def kill(self, what: str, n: int) -> None:
        """Of them; or its pages are opened anew."""
        self.history.play((what, n))

    @rule(what=st.sampled_from(["kill", "start", "thaw", "cut", "cut_subscribers"]))
    def redis_does(self, what: str) -> None:
        """To itself, or to its connections."""
        self.history.play(("redis_does", what))

    @rule(what=st.sampled_from(["lose", "spoil"]), key=keys)
    def redis_loses(self, what: str, key: str) -> None:
        """One key, or all of them; or something else stands there."""
        self.history.play(("redis_does", what, key))

    @rule(
        name=st.sampled_from(["frozen", "loading", "readonly", "locked", "evicting"]),
        value=st.booleans(),
    )
    def redis_is(self, name: str, value: bool) -> None:
        """Unable to do its work."""
        if name != "frozen" or value:
            self.history.play(("redis_is", name, value))

    @rule(delay_s=st.sampled_from([0.0005, 0.03, 0.1, 0.2]))
    def redis_is_slow(self, delay_s: float) -> None:
        """Or quick."""
        self.history.play(("redis_is", "delay_s", delay_s))

    @rule(step_s=st.sampled_from([-3600.0, -5.0, -0.5, 0.5, 5.0, 3600.0]))
    def redis_clock(self, step_s: float) -> None:
        """Its clock is set."""
        self.history.play(("redis_clock", step_s))

    @rule()
    def quiet(self) -> None:
        """For a while."""
        self.history.play(("quiet",))


class Test(Histories.TestCase):  # type: ignore[valid-type, misc]
    """The same each time: what fails here is what was changed.

    Nothing is cut down, which takes minutes: the steps that are printed can be kept and cut by hand.
    """

    settings = settings(
        max_examples=count_examples(30, few=8),
        stateful_step_count=25,
        deadline=None,
        derandomize=True,
        database=None,
        phases=[Phase.generate],
    )


@pytest.mark.full
class TestMany(Histories.TestCase):  # type: ignore[valid-type, misc]
    """Others each time."""

    settings = settings(max_examples=2000, stateful_step_count=40, deadline=None)
