"""Who may see what: one pure function for streams, events, state, the list and models.

A robot has one rule per audience. A caller without proof is `anyone`; a share link or a sign-in takes
precedence. If no rule admits a caller, the robot looks like one that does not exist.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from posecast_wire import Close

PUBLIC = "public"  # the default view, unless a profile defines others
DELAY_MAX_S = 60.0
FULL_HZ = 60.0  # the highest live rate: a rule with a lower rate may skip frames
PAST_S = 1800.0  # how far back an audience with live access may look by default


class Audience(StrEnum):
    """The kind of caller, by the proof it gave. The values are the names used in the file of `--robots`."""

    ANYONE = "anyone"
    SIGNED_IN = "signed-in"
    LINK = "link"


@dataclass(frozen=True)
class Rule:
    """What an audience may see of a robot. `viewers`: of this audience at a time, in this process.

    `frames`: origins of pages that may embed what `anyone` sees; None: any page. `past_s`: how far back it
    may look, in seconds; None: not set.
    """

    view: str = PUBLIC
    hz: float = FULL_HZ
    delay_s: float = 0.0
    viewers: int | None = None
    blackout: bool = False
    frames: tuple[str, ...] | None = None
    past_s: float | None = None

    def compute_past_s(self, audience: Audience) -> float:
        """Return how far back `audience` may look under this rule, in seconds.

        0 if frames may be skipped, because segments hold all frames. Also 0 by default for share links and
        for delayed views.
        """
        if self.hz < FULL_HZ:
            return 0.0
        if self.past_s is not None:
            return self.past_s
        return 0.0 if audience is Audience.LINK or self.delay_s > 0 else PAST_S


@dataclass(frozen=True)
class Principal:
    """A caller, as its `token` proves. `robot`: the one that a share link opens. `until_s`: unix s."""

    audience: Audience = Audience.ANYONE
    robot: str | None = None
    until_s: float = float("inf")
    token: str = field(default="", repr=False)


ANYONE = Principal()


@dataclass(frozen=True)
class Grant:
    """What a caller may see: one view of a robot, the rate, the delay, the past, and the audience whose rule
    applies."""

    robot: str
    view: str
    hz: float
    delay_s: float
    viewers: int | None
    by: Audience
    who: Principal
    past_s: float = 0.0  # how far back from what is shown live; 0: no past
    lane: str | None = None  # where they read on if the relay is full

    @property
    def open(self) -> bool:
        """Whether the rule is that of `anyone`, so that any page may read the response."""
        return self.by is Audience.ANYONE


Rules = Mapping[str, Mapping[Audience, Rule]]  # by robot
EVERYBODY: Mapping[Audience, Rule] = {Audience.ANYONE: Rule()}


@dataclass(frozen=True)
class Policy:
    """The rules of all robots. `rules` None: every robot's public view is open, as with --dev.

    `keeps_s`: for how many seconds an object store keeps a robot's past, by robot; other robots are not
    stored.
    """

    rules: Rules | None = None
    keeps_s: Mapping[str, float] = field(default_factory=dict)

    def find_rules(self, robot: str) -> Mapping[Audience, Rule]:
        """Return the rules of one robot by audience; empty for an unlisted robot."""
        return EVERYBODY if self.rules is None else self.rules.get(robot, {})

    def judge(self, who: Principal, robot: str, view: str | None = None) -> Grant | Close:
        """Return what `who` may see of a robot.

        ABSENT if they may see nothing; FORBIDDEN if they may see another view but not `view`.
        """
        rules = self.find_rules(robot)
        found = [
            Grant(
                *(robot, rule.view, rule.hz, rule.delay_s, rule.viewers, audience, who),
                past_s=rule.compute_past_s(audience),
            )
            for audience in dict.fromkeys((who.audience, Audience.ANYONE))
            if (rule := rules.get(audience)) is not None
            and not rule.blackout
            and (audience is not Audience.LINK or who.robot == robot)
        ]
        if not found:
            return Close.ABSENT
        return next((grant for grant in found if view in (None, grant.view)), Close.FORBIDDEN)

    def list_frame_ancestors(self, robot: str, listed: Collection[str]) -> tuple[str, ...]:
        """Return the pages that may embed a robot, as sources of CSP's `frame-ancestors`; `robot` "": any
        robot.

        `listed`: external pages that may show restricted data. A request for a frame carries no proof yet, so
        a hidden robot gets the same answer as one that does not exist.
        """
        rule = self.find_rules(robot).get(Audience.ANYONE)
        if rule is None or rule.blackout:
            return ("'self'", *listed)
        return ("*",) if rule.frames is None else ("'self'", *rule.frames)

    def find_delays_s(self) -> dict[tuple[str, str], float]:
        """Return the delays of the delayed views in seconds, by robot and view."""
        return {
            (robot, rule.view): rule.delay_s
            for robot, rules in (self.rules or {}).items()
            for rule in rules.values()
            if rule.delay_s > 0
        }
