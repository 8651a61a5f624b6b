"""What an attacker knows about the relay, and how attacks are written.

An attack is a generator: it prepares before its only `yield`, attacks after it, and returns a short summary
of what it did. Its docstring is its line in the table.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, field

Steps = Generator[None, None, str]
ATTACKS: dict[str, Attack] = {}
SECONDS = 1.5


@dataclass
class Target:
    """A relay: `http` and `zenoh` are HOST:PORT. `secret`: of the robot `rude`, where one is asked for."""

    http: str
    zenoh: str
    seconds: float
    secret: str | None = None
    end_s: float = field(default=0.0, init=False)  # monotonic

    @property
    def address(self) -> tuple[str, int]:
        """Of HTTP, as sockets want it."""
        host, _, port = self.http.rpartition(":")
        return host, int(port)

    @property
    def zenoh_address(self) -> tuple[str, int]:
        """Of Zenoh, likewise."""
        host, _, port = self.zenoh.rpartition(":")
        return host, int(port)

    def over(self) -> bool:
        """Whether the attack's time has passed."""
        return time.monotonic() >= self.end_s

    def paced(self, per_s: float, act: Callable[[], object]) -> str:
        """Calls `act` at this rate until the time is over; missed calls are not repeated. Returns the
        achieved rate."""
        began_s = due_s = time.monotonic()
        count = 0
        while due_s < self.end_s:
            due_s = max(due_s, time.monotonic() - 0.05)
            wait_s = due_s - time.monotonic()
            if wait_s > 0:
                time.sleep(wait_s)
            act()
            count += 1
            due_s += 1 / per_s
        return f"{count / max(time.monotonic() - began_s, 0.001):,.0f}/s"


@dataclass(frozen=True)
class Attack:
    """`guarded`: on a relay that asks robots for credentials; the attacker has one. `behind_redis`: robots on
    an ingest, viewers on a gateway.
    """

    name: str
    what: str
    steps: Callable[[Target], Steps]
    seconds: float
    guarded: bool
    behind_redis: bool


def attack(
    seconds: float = SECONDS, guarded: bool = False, behind_redis: bool = False
) -> Callable[[Callable[[Target], Steps]], Callable[[Target], Steps]]:
    """Enter a function into ATTACKS under its name."""

    def enter(steps: Callable[[Target], Steps]) -> Callable[[Target], Steps]:
        name = steps.__name__.replace("_", "-")
        what = " ".join((steps.__doc__ or "").split()).rstrip(".")
        ATTACKS[name] = Attack(name, what, steps, seconds, guarded, behind_redis)
        return steps

    return enter
