"""Who may see what: one pure function, asked by the stream, by events, by the state, the list and the models.

A robot's rules are by audience. Whoever proves nothing is `anyone`; a share link or a signed-in account comes
before that. Where no rule lets somebody in, the robot is absent, as one that does not exist is.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from posecast_wire import Close

PUBLIC = "public"  # the view that there is unless a profile says otherwise
DELAY_MAX_S = 60.0
FULL_HZ = 60.0  # the most that anybody gets live: a rule of less may leave frames out
PAST_S = 1800.0  # how far back an audience may look that sees a robot live, unless its rule says otherwise


class Audience(StrEnum):
    """Who asks, by how they proved it. The values are the names used in the file of `--robots`."""

    ANYONE = "anyone"
    SIGNED_IN = "signed-in"
    LINK = "link"


@dataclass(frozen=True)
class Rule:
    """What an audience gets of a robot. `viewers`: of this audience at a time, in this process.

    `frames`: origins of pages that may frame what `anyone` sees; None: any page. `past_s`: how far back it
    may look, in seconds; None: nothing is said of it.
    """

    view: str = PUBLIC
    hz: float = FULL_HZ
    delay_s: float = 0.0
    viewers: int | None = None
    blackout: bool = False
    frames: tuple[str, ...] | None = None
    past_s: float | None = None

    def compute_past_s(self, audience: Audience) -> float:
        """Return how far back `audience` may look by this rule, in seconds.

        0 where frames may be left out, since a segment holds them all; and, unless the rule says otherwise,
        for share links and for what is delayed.
        """
        if self.hz < FULL_HZ:
            return 0.0
        if self.past_s is not None:
            return self.past_s
        return 0.0 if audience is Audience.LINK or self.delay_s > 0 else PAST_S


@dataclass(frozen=True)
class Principal:
    """Who asks, as far as `token` proves it. `robot`: the one that a share link opens. `until_s`: unix."""

    audience: Audience = Audience.ANYONE
    robot: str | None = None
    until_s: float = float("inf")
    token: str = field(default="", repr=False)


ANYONE = Principal()


@dataclass(frozen=True)
class Grant:
    """What somebody may see: one view of one robot, so often, so late, so far back, and by which audience's
    rule."""

    robot: str
    view: str
    hz: float
    delay_s: float
    viewers: int | None
    by: Audience
    who: Principal
    is_preview: bool = False  # a card in a list: counted as no viewer, and the first to go
    past_s: float = 0.0  # how far back from what is shown now; 0: not at all
    lane: str | None = None  # where they read on when the relay has no place for them

    @property
    def open(self) -> bool:
        """Whether the rule is that of `anyone`, so that any page may read it."""
        return self.by is Audience.ANYONE


Rules = Mapping[str, Mapping[Audience, Rule]]  # by robot
EVERYBODY: Mapping[Audience, Rule] = {Audience.ANYONE: Rule()}


@dataclass(frozen=True)
class Policy:
    """The rules of all robots. `rules` None: every robot's public view is open, as with --dev.

    `keeps_s`: for how many seconds the past of a robot stays in an object store, by robot; of others nothing.
    """

    rules: Rules | None = None
    keeps_s: Mapping[str, float] = field(default_factory=dict)

    def find_rules(self, robot: str) -> Mapping[Audience, Rule]:
        """Return the rules of one robot by audience; empty for a robot that is not named."""
        return EVERYBODY if self.rules is None else self.rules.get(robot, {})

    def judge(self, who: Principal, robot: str, view: str | None = None) -> Grant | Close:
        """Return what `who` may see of a robot.

        ABSENT when they may see nothing, FORBIDDEN when they may see another view than `view`.
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
        """Return the pages that may frame a robot, as sources of CSP's `frame-ancestors`; `robot` "": any
        robot.

        `listed`: pages elsewhere that may show what is not for everybody. Whoever asks for a frame proves
        nothing yet, so a robot that is hidden is answered like one that does not exist.
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
