"""The locustfile of a named scenario: its users, and how many of them at which time.

locust -f loadtests/src/posecast_loadtests/scenario_file.py --headless --scenario lecture -H ws://127.0.0.1:8080
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from locust import LoadTestShape, User, events

from posecast_loadtests.browser import BrowserUser
from posecast_loadtests.publisher import PublisherUser
from posecast_loadtests.scenarios import Stage
from posecast_loadtests.user import ViewerUser, scenario

__all__ = ["BrowserUser", "PublisherUser", "Stages", "ViewerUser"]

FLEET_FIRST_S = 3.0  # robots come online before the first viewer


class Stages(LoadTestShape):
    """Follows the scenario's stages; ends the test after the last."""

    def tick(self) -> tuple[int, float, list[type[User]]] | None:
        """Return the number of users, the new ones per second and their classes; None at the end."""
        assert self.runner is not None
        asked = scenario(self.runner.environment)
        users: list[type[User]] = [ViewerUser, BrowserUser]
        others = BrowserUser.fixed_count
        at_s: float = self.get_run_time()  # type: ignore[no-untyped-call]
        if asked.robots:
            users.append(PublisherUser)
            others += PublisherUser.fixed_count
            at_s -= FLEET_FIRST_S
            if at_s < 0:
                return PublisherUser.fixed_count, 1.0, [PublisherUser]
        for before, stage in pairwise((Stage(0.0, 0.0), *asked.stages)):
            if at_s < stage.until_s:
                arriving = (stage.share - before.share) * asked.viewers / (stage.until_s - before.until_s)
                return round(stage.share * asked.viewers) + others, max(1.0, arriving), users
        return None


def _arguments(parser: Any) -> None:
    parser.add_argument("--zenoh", default="tcp/127.0.0.1:7447", help="where the fleet's robots connect")


_hooks: Any = events
_hooks.init_command_line_parser.add_listener(_arguments)
