"""Describes load tests: when viewers arrive, how they read, how long they stay, and which limits apply."""

from __future__ import annotations

from dataclasses import dataclass, field

from posecast_loadtests.results import LoadLimits


@dataclass(frozen=True)
class Stage:
    """This share of the viewers has arrived by `until_s`, counted from the start of the test."""

    until_s: float
    share: float


@dataclass(frozen=True)
class Scenario:
    """One named test. Shares are of the viewers; a viewer's kind follows from its number."""

    name: str
    title: str
    viewers: int
    stages: tuple[Stage, ...]
    hz: float = 10.0
    churn_per_min: float = 0.0  # share that leaves each minute and returns as a new viewer
    slow: float = 0.0  # share that reads SLOW_BYTES_PER_S
    frozen: float = 0.0  # share that stops reading, like a phone in a pocket
    robots: int = 0  # a fleet of this many robots, 30 Hz each; 0: the demo robot
    limits: LoadLimits = field(default_factory=LoadLimits)

    @property
    def seconds(self) -> float:
        """How long it takes, in seconds."""
        return self.stages[-1].until_s

    def kind(self, number: int) -> str:
        """Return `slow`, `frozen` or `healthy` for a viewer's number. The kinds are spread evenly."""
        if int((number + 1) * self.frozen) > int(number * self.frozen):
            return "frozen"
        other = number - int(number * self.frozen)  # its number among the viewers that are not frozen
        slow = self.slow / (1 - self.frozen)
        return "slow" if int((other + 1) * slow) > int(other * slow) else "healthy"

    def stretched(self, factor: float, viewers: int | None) -> Scenario:
        """Return a copy with all times multiplied, and with this number of viewers."""
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
            "a lecture: viewers arrive for half a minute, a fifth more later; a tenth per minute come and go",
            viewers=1000,
            stages=(Stage(30, 0.8), Stage(60, 0.8), Stage(62, 1.0), Stage(90, 1.0)),
            churn_per_min=0.1,
        ),
        Scenario(
            "flash-crowd",
            "a flash crowd: everybody opens the link within three seconds",
            viewers=1000,
            stages=(Stage(3, 1.0), Stage(30, 1.0)),
        ),
        Scenario(
            "fleet",
            "a fleet: a hundred robots at 30 Hz, a few viewers each",
            viewers=300,
            stages=(Stage(10, 1.0), Stage(40, 1.0)),
            robots=100,
        ),
        Scenario(
            "slow-phones",
            "slow phones: a fifth read 1 kB/s, one in twenty stops reading; the others must not be affected",
            viewers=500,
            stages=(Stage(10, 1.0), Stage(55, 1.0)),
            slow=0.2,
            frozen=0.05,
        ),
    )
}

SOAK = Scenario(  # for `make soak`; not part of `make load`
    "soak",
    "half an hour: a tenth per minute come and go, some read slowly, some stop reading",
    viewers=200,
    stages=(Stage(20, 1.0), Stage(1800, 1.0)),
    churn_per_min=0.1,
    slow=0.05,
    frozen=0.02,
)
