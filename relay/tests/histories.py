"""What may happen to a fleet, as steps of a history, and what must hold whatever has happened.

A step is plain data, so that a history that once failed can be kept and played again.
"""

from __future__ import annotations

from collections.abc import Coroutine
from typing import Any, TypeVar

from .fleet import DELAY_S, Fleet, FleetEdge, Ingest
from .page import STALE_S, Page
from .sim_loop import SimLoop
from .sim_redis import SimLink, SimRedis

ROBOTS = ("a", "b")
SLACK_S = 0.5  # of the age of a frame that came through a Redis with a fifth of a second each way
LOOK_S = 0.05
BACK_S = 2.0  # everything is LIVE so long after quiet returned
RETURN_S = 3.0 + BACK_S + 1.0  # where one edge takes another's place, or an ingest lost its link to one
RELEARN_S = 10.0 + BACK_S  # where an edge's clock stood still
STEADY_S = 3.0  # and stays it

Step = tuple[Any, ...]
T = TypeVar("T")


class History:
    """A fleet with a simulated clock and Redis. `play` carries out steps; `quiet` lets it heal and checks."""

    def __init__(self) -> None:
        self.loop = SimLoop()
        self.redis = SimRedis(self.loop)
        self.fleet = Fleet(self.loop, "redis://simulated", lambda _url: SimLink(self.redis))
        self.steps: list[Step] = []
        self.pages: list[Page] = []
        self.back_s = BACK_S
        self._checked: dict[Page, int] = {}

    # ---- steps ----------------------------------------------------------------

    def play(self, *steps: Step) -> None:
        """One after the other."""
        for name, *about in steps:
            self.steps.append((name, *about))
            getattr(self, str(name))(*about)
            self.check()

    def wait(self, seconds: float) -> None:
        """Nothing happens; every page is looked at."""
        until = self.loop.time() + seconds
        while self.loop.time() < until - 1e-6:
            self.loop.pass_time(min(LOOK_S, until - self.loop.time()))
            self.fleet.look()
            if self.redis.evicting:
                self.redis.evict()

    def edge(self, robot: str, *ingests: int) -> None:
        """An edge starts, and finds these ingests."""
        if len(self.fleet.edges) < 4:
            known = [ingest for i, ingest in enumerate(self.fleet.ingests) if i in ingests]
            if any(edge.robot == robot for edge in (*self.fleet.edges, *self._leased(known))):
                self.back_s = max(self.back_s, RETURN_S)
            self.fleet.edge(robot, *known)

    def stop(self, n: int, killed: bool) -> None:
        """An edge ends."""
        edge = self._edge(n)
        if edge is not None:
            if any(other is not edge and other.robot == edge.robot for other in self.fleet.edges):
                self.back_s = max(self.back_s, RETURN_S)
            self.fleet.stop(edge, killed)

    def silence(self, n: int, sends: bool) -> None:
        """An edge's source stands still, or goes on."""
        edge = self._edge(n)
        if edge is not None:
            edge.sends = sends
            self.back_s = max(self.back_s, RETURN_S)

    def link(self, n: int, ingest: int, connected: bool) -> None:
        """Between an edge and an ingest."""
        edge = self._edge(n)
        if edge is not None and ingest < len(self.fleet.ingests):
            (edge.connect if connected else edge.disconnect)(self.fleet.ingests[ingest])
            self.back_s = max(self.back_s, RETURN_S)

    def clock(self, n: int, rate: float) -> None:
        """An edge's clock runs otherwise from now on."""
        edge = self._edge(n)
        if edge is not None:
            edge.run_clock(rate)
            self.back_s = max(self.back_s, RELEARN_S)

    def ingest(self) -> None:
        """One more; every edge finds it."""
        if len(self.fleet.ingests) < 2:
            ingest = self._run(self.fleet.ingest())
            for edge in self.fleet.edges:
                edge.connect(ingest)

    def kill_ingest(self, n: int) -> None:
        """At once."""
        if n < len(self.fleet.ingests):
            self._run(self.fleet.kill(self.fleet.ingests[n]))

    def gateway(self) -> None:
        """One more, with pages for each robot."""
        if len(self.fleet.gateways) < 2:
            self._run(self.fleet.gateway())
            self.watch(len(self.fleet.gateways) - 1)

    def kill_gateway(self, n: int) -> None:
        """At once, with all its pages."""
        if n < len(self.fleet.gateways):
            gateway = self.fleet.gateways[n]
            self._run(self.fleet.kill(gateway))
            for page in (*gateway.pages.values(), *gateway.later_pages.values()):
                self.pages.remove(page)

    def watch(self, n: int) -> None:
        """New pages take the place of those at a gateway."""
        if n < len(self.fleet.gateways):
            gateway = self.fleet.gateways[n]
            gateway.leave()
            for robot in ROBOTS:
                self.pages += [gateway.watch(robot), gateway.watch_later(robot)]

    def redis_does(self, what: str, *about: object) -> None:
        """Something of its own, by the method's name."""
        getattr(self.redis, what)(*about)

    def redis_is(self, name: str, value: object) -> None:
        """In this state from now on."""
        setattr(self.redis, name, value)
        if name == "locked":
            self.redis.cut()

    def redis_clock(self, step_s: float) -> None:
        """It is set."""
        self.redis.clock_s += step_s

    # ---- what must hold --------------------------------------------------------

    def check(self) -> None:
        """At any time."""
        assert not self.loop.faults, self.loop.faults
        for process in (*self.fleet.ingests, *self.fleet.gateways):
            assert process.hub.outcomes["fault"] == 0, process
        for page in self.pages:
            assert page.ended is None, page.ended
            assert page.undecodable == 0
            new = page.shown[self._checked.get(page, 0) :]
            self._checked[page] = len(page.shown)
            for shown in new:
                age_s = shown.at - shown.pose_at - page.delay_s if shown.pose_at is not None else 0.0
                assert age_s > -1e-6, f"{page.robot}: a pose {-age_s:.2f} s before its time"
                if shown.word == "LIVE":
                    assert age_s <= STALE_S + SLACK_S, f"{page.robot}: LIVE, and {age_s:.2f} s old"
            _in_order(page)

    def quiet(self) -> None:
        """Whatever was wrong has passed: everything that sends is LIVE at every gateway, and stays so."""
        redis, fleet = self.redis, self.fleet
        if not redis.up:
            redis.start()
        if redis.frozen:
            redis.thaw()
        redis.loading = redis.readonly = redis.locked = redis.evicting = False
        redis.delay_s = 0.0005
        for edge in fleet.edges:
            edge.run_clock(1.0)
        if not fleet.ingests:
            self.ingest()
        if not fleet.gateways:
            self.gateway()
        self.wait(self.back_s)
        since = self.loop.time()
        self.wait(STEADY_S + DELAY_S)
        self.check()
        for gateway in fleet.gateways:
            for robot in self.on_air():
                for page in (gateway.pages[robot], gateway.later_pages[robot]):
                    _is_live(page, since + page.delay_s, self.back_s)
        self.back_s = BACK_S

    def on_air(self) -> set[str]:
        """The robots whose frames reach an ingest."""
        return {edge.robot for edge in self.fleet.edges if edge.sends and edge.ingests}

    def end(self) -> None:
        """Let go of everything."""
        self._run(self.fleet.end())
        self.loop.end()

    def _leased(self, known: list[Ingest]) -> list[FleetEdge]:
        """Edges that were killed, and that an ingest not among these believes to be there."""
        others = [ingest for ingest in self.fleet.ingests if ingest not in known]
        return [edge for ingest in others for edge in ingest.edges if edge.was_killed]

    def _edge(self, n: int) -> FleetEdge | None:
        return self.fleet.edges[n] if n < len(self.fleet.edges) else None

    def _run(self, work: Coroutine[Any, Any, T]) -> T:
        return self.loop.run(work)


def _is_live(page: Page, since: float, back_s: float) -> None:
    """From then on, and what it shows is as new as it can be."""
    odd = next((shown for shown in page.shown if shown.at >= since and shown.word != "LIVE"), None)
    assert odd is None, f"{page.robot}: {odd.word}, {odd.at - since + back_s:.2f} s after quiet"
    last = page.look()
    assert last.pose_at is not None
    assert last.at - last.pose_at - page.delay_s < 0.5


def _in_order(page: Page) -> None:
    """No frame of a run twice, none after a later one; a run that comes back goes on where it was."""
    last: dict[int, int] = {}
    before = 0
    for run_id, seq in page.poses[-200:]:
        least = last.get(run_id, -1) + (run_id == before)
        assert seq >= least, f"{page.robot}: frame {seq} of run {run_id:x} after {last[run_id]}"
        before, last[run_id] = run_id, seq
