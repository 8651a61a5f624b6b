"""The lane: where viewers can read on when the relay is full.

The lane serves the public past as segments over HTTP, through any cache. It is offered only if those segments
show exactly what `anyone` sees live.
"""

from __future__ import annotations

import math

from posecast_relay.core.policy.past import shows_all
from posecast_relay.core.policy.policy import Audience, Policy

LANE_PAST_S = 15.0  # a segment lasts at most 6 s, and a request for the next one may be 9 s late
TRIES_PER_S = 20.0  # attempts of lane readers to get a stream: each refusal costs half a millisecond
PACE_S = 60.0  # the time over which arrivals are counted
RETRY_S_MAX = 600.0

NO_PAST = "this process keeps no past (--past 0)"
NOT_OPEN = "`anyone` may not see it"
DELAYED = "`anyone` sees it with a delay"
NOT_ALL = "`anyone` gets a reduced rate (`hz`)"
NO_LOOK_BACK = f"`anyone` may look back less than {LANE_PAST_S:g} s (`past`)"
CAPPED = "its own rule limits the viewers (`viewers`)"


def find_lane(policy: Policy, robot: str, view: str | None) -> str | None:
    """Return the lane's address as sent in `bye`, relative to that of the stream; None if there is no lane.

    `view` None: any view that `anyone` may see. The lane may not have a segment yet.
    """
    return (
        None
        if explain_no_lane(policy, robot, view)
        else f"past/{policy.find_rules(robot)[Audience.ANYONE].view}"
    )


def explain_no_lane(policy: Policy, robot: str, view: str | None) -> str | None:
    """Return why the rules give a robot and view no lane, for the log; None if they have one."""
    rule = policy.find_rules(robot).get(Audience.ANYONE)
    if rule is None or rule.blackout or rule.viewers == 0 or view not in (None, rule.view):
        return NOT_OPEN
    if rule.delay_s > 0:
        return DELAYED
    if not shows_all(rule):
        return NOT_ALL
    return None if rule.compute_past_s(Audience.ANYONE) >= LANE_PAST_S else NO_LOOK_BACK


class RetryPace:
    """Decides when viewers in the lane retry a stream: the more there are, the longer each waits.

    Otherwise the load on a full relay would grow with the number of lane readers, although caches serve them.
    """

    def __init__(self) -> None:
        self._came = 0.0  # recent arrivals, weighted down with age
        self._at = 0.0

    def choose_retry_s(self, least_s: float, now: float) -> float:
        """Count one more viewer sent to the lane, and return in how many seconds it may retry."""
        self._came = self._came * math.exp((self._at - now) / PACE_S) + 1.0
        self._at = now
        return max(least_s, min(RETRY_S_MAX, float(round(self._came / TRIES_PER_S))))
