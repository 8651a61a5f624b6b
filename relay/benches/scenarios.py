"""What is measured: who watches how much, for how long, on which servers."""

from __future__ import annotations

from dataclasses import dataclass

FRAME_BYTES = 200
ALL = ("bare", "relay", "websockets", "fastapi")
RELAYS = ("relay", "relay-write")  # the second without io_uring
TIMED = ("relay", "fastapi")
OURS = ("relay",)


@dataclass(frozen=True)
class Scenario:
    name: str
    title: str
    viewers: int
    hz: float  # frames per second to each viewer
    servers: tuple[str, ...] = ALL
    storm: bool = False  # all at once; the window is the storm
    robot_hz: float = 0.0  # what the relay is fed, a multiple of hz; 0: the same
    frozen: int = 0  # of the viewers, from the window's beginning
    resume_after_s: float = 0.0
    seconds: float = 8.0
    frame_bytes: int = FRAME_BYTES
    lookers: int = 0  # who look back, beside the viewers
    lag: bool = False  # event-loop lateness, from a timer inside the server

    @property
    def step(self) -> int:
        """How far seq moves from one frame that is due to the next, on the relay."""
        return round(self.robot_hz / self.hz) if self.robot_hz else 1


SCENARIOS = (
    Scenario("steady-1000", "1,000 viewers × 30 Hz", 1000, 30, (*ALL, "relay-write")),
    Scenario("steady-2000", "2,000 viewers × 30 Hz", 2000, 30),
    # A relay gives nobody more than 60 Hz, so saturation is more viewers than one core serves at 60 Hz.
    Scenario("saturation", "saturation: 4,000 viewers × 60 Hz asked for", 4000, 60),
    Scenario("storm", "4,000 handshakes at once", 4000, 1, storm=True, lag=True),
    Scenario("ten-hz", "2,000 viewers × 10 Hz (robot at 30 Hz)", 2000, 10, robot_hz=30),
    Scenario("loop", "3,000 viewers × 10 Hz, loop timed", 3000, 10, TIMED, robot_hz=30, lag=True),
    # Baseline and freeze stand beside each other in every round, so that they have the same neighbours.
    Scenario("healthy", "1,000 viewers × 30 Hz, none frozen (baseline)", 1000, 30, OURS, seconds=10),
    Scenario("frozen", "1,000 viewers × 30 Hz, 50 frozen for good", 1000, 30, OURS, frozen=50, seconds=24),
    Scenario("resumed", "1,000 viewers × 30 Hz, 50 frozen for 10 s", 1000, 30, OURS, frozen=50,
             resume_after_s=10, seconds=13),
    Scenario("looking-back", "1,000 viewers × 30 Hz, 200 more look back", 1000, 30, OURS, lookers=200,
             seconds=10),
)  # fmt: skip

QUICK = ("steady-1000", "storm")
