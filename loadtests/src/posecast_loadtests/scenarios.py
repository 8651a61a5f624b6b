"""What a load test does: who comes when, how they read, how long they stay, and what must hold."""

from __future__ import annotations

from dataclasses import dataclass, field

from posecast_loadtests.results.tally import LoadLimits


@dataclass(frozen=True)
class Stage:
    """By `until_s` (from the test's beginning) this share of the viewers has arrived."""

    until_s: float
    share: float


@dataclass(frozen=True)
class Scenario:
    """One named test. Shares are of the viewers; every viewer's kind follows from its number."""

    name: str
    title: str
    viewers: int
    stages: tuple[Stage, ...]
    hz: float = 10.0
    churn_per_min: float = 0.0  # share that leaves each minute and comes back as somebody new
    slow: float = 0.0  # read SLOW_BYTES_PER_S
    frozen: float = 0.0  # stop reading, like a phone put away
    robots: int = 0  # a fleet of as many, 30 Hz each; 0: the demo robot
    limits: LoadLimits = field(default_factory=LoadLimits)

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return self.stages[-1].until_s

    def kind(self, number: int) -> str:
        """`slow`, `frozen` or `healthy` for the viewer of this number, spread evenly over those who come."""
        if int((number + 1) * self.frozen) > int(number * self.frozen):
            return "frozen"
        other = number - int(number * self.frozen)  # its number among those who are not
        slow = self.slow / (1 - self.frozen)
        return "slow" if int((other + 1) * slow) > int(other * slow) else "healthy"

    def stretched(self, factor: float, viewers: int | None) -> Scenario:
        """The same with every time multiplied, and with so many viewers."""
        stages = tuple(Stage(s.until_s * factor, s.share) for s in self.stages)
        return Scenario(
            self.name, self.title, viewers or self.viewers, stages, self.hz, self.churn_per_min,
            self.slow, self.frozen, self.robots, self.limits,
        )  # fmt: skip


SCENARIOS = {
    s.name: s
    for s in (
        Scenario(
            "lecture",
            "a lecture: half a minute of arriving, a fifth more later on, a tenth a minute come and go",
            viewers=1000,
            stages=(Stage(30, 0.8), Stage(60, 0.8), Stage(62, 1.0), Stage(90, 1.0)),
            churn_per_min=0.1,
        ),
        Scenario(
            "flash-crowd",
            "a flash crowd: the link is on the screen, everybody opens it within three seconds",
            viewers=1000,
            stages=(Stage(3, 1.0), Stage(30, 1.0)),
        ),
        Scenario(
            "fleet",
            "a fleet: a hundred robots of 30 Hz at once, a few viewers each",
            viewers=300,
            stages=(Stage(10, 1.0), Stage(40, 1.0)),
            robots=100,
        ),
        Scenario(
            "slow-phones",
            "slow phones: a fifth read 1 kB/s, one in twenty is put away; the others must not notice",
            viewers=500,
            stages=(Stage(10, 1.0), Stage(55, 1.0)),
            slow=0.2,
            frozen=0.05,
        ),
    )
}

SOAK = Scenario(  # `make soak`; not among those that `make load` plays
    "soak",
    "half an hour: a tenth a minute come and go, some read slowly, some stop reading",
    viewers=200,
    stages=(Stage(20, 1.0), Stage(1800, 1.0)),
    churn_per_min=0.1,
    slow=0.05,
    frozen=0.02,
)
