"""The lane: where somebody reads on for whom a full relay has no place.

It is what anyone may look back on, as segments by HTTP, through any cache; so it is told only where these are
what anyone sees live.
"""

from __future__ import annotations

import math

from posecast_relay.core.policy.past import shows_all
from posecast_relay.core.policy.policy import Audience, Policy

LANE_PAST_S = 15.0  # a segment lasts 6 s at most, and who waits for the next one may come 9 s late
TRIES_PER_S = 20.0  # of those in the lane, for a stream: a refusal costs half a millisecond
PACE_S = 60.0  # how far back it counts how many came
RETRY_S_MAX = 600.0

NO_PAST = "this process keeps no past (--past 0)"
NOT_OPEN = "it is not open to anyone"
DELAYED = "anyone sees it with a delay"
NOT_ALL = "anyone gets fewer frames than there are (`hz`)"
NO_LOOK_BACK = f"anyone may not look back on it for {LANE_PAST_S:g} s (`past`)"
CAPPED = "as many viewers watch it as its own rule allows (`viewers`)"


def find_lane(policy: Policy, robot: str, view: str | None) -> str | None:
    """Return the address of the lane as `bye` tells it, to be resolved against that of the stream; None where
    there is none.

    `view` None: whichever anyone may see. There may be no segment there yet.
    """
    return (
        None
        if explain_no_lane(policy, robot, view)
        else f"past/{policy.find_rules(robot)[Audience.ANYONE].view}"
    )


def explain_no_lane(policy: Policy, robot: str, view: str | None) -> str | None:
    """Return why a robot and view have no lane by the rules, as the log says it; None where they have one."""
    rule = policy.find_rules(robot).get(Audience.ANYONE)
    if rule is None or rule.blackout or rule.viewers == 0 or view not in (None, rule.view):
        return NOT_OPEN
    if rule.delay_s > 0:
        return DELAYED
    if not shows_all(rule):
        return NOT_ALL
    return None if rule.compute_past_s(Audience.ANYONE) >= LANE_PAST_S else NO_LOOK_BACK


class RetryPace:
    """When those who are sent to the lane are to try a stream again: the more they are the more seldom.

    Else what a full relay has to do would grow with all who read the lane, though caches serve these.
    """

    def __init__(self) -> None:
        self._came = 0.0  # lately, each the less the longer ago
        self._at = 0.0

    def choose_retry_s(self, least_s: float, now: float) -> float:
        """Count one more who is sent to the lane; return in how many seconds they may come again."""
        self._came = self._came * math.exp((self._at - now) / PACE_S) + 1.0
        self._at = now
        return max(least_s, min(RETRY_S_MAX, float(round(self._came / TRIES_PER_S))))
