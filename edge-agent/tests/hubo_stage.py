"""A Hubo that walks: rows of a trajectory file as the daemon's frames, 200 a second."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hubo_structs import SLOT, state
from posecast_edge.profile.types import Profile

PERIOD_S = 0.005
LAG = 0.3  # of the way that pos goes towards ref in a period


class Walker:
    """Plays a file of hubo-read-trajectory over and over. Row k is sent at robot time `at_s(k)`.

    `inactive`: joints the robot's table does not have.
    """

    def __init__(
        self, profile: Profile, path: Path, put: Callable[[bytes], None], inactive: tuple[str, ...] = ()
    ) -> None:
        assert profile.trajectory is not None
        self.columns = profile.trajectory.columns
        self.rows = [
            [float(x) for x in line.split()] for line in path.read_text().splitlines() if line.strip()
        ]
        self._put = put
        self.state = robot = state()
        for name, slot in SLOT.items():
            robot.status[slot].homeFlag = 2 if name in ("LWR", "RWR") else 6
            robot.status[slot].ctrlOn = robot.status[slot].driverOn = 1
            robot.joint[slot].active = name not in inactive
            robot.joint[slot].tmp = 36.5
        robot.ft[2].f_z = robot.ft[3].f_z = 210.0
        robot.power.voltage, robot.power.current, robot.power.power = 48.0, 3.0, 144.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def row(self, t_s: float) -> dict[str, float]:
        """What the joints were told at that robot time."""
        values = self.rows[round(t_s / PERIOD_S) % len(self.rows)]
        return {c: v for c, v in zip(self.columns, values, strict=False) if c != "-"}

    def end(self) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        k, next_s = 0, time.monotonic()
        robot: Any = self.state
        while not self._stop.is_set():
            next_s = max(next_s + PERIOD_S, time.monotonic() - 0.1)
            time.sleep(max(0.0, next_s - time.monotonic()))
            k += 1
            robot.time = k * PERIOD_S
            for name, value in self.row(robot.time).items():
                joint = robot.joint[SLOT[name]]
                joint.ref = value
                joint.pos += (value - joint.pos) * LAG
                joint.cur = (value - joint.pos) * 20
            self._put(bytes(robot))


def main() -> None:
    """`python hubo_stage.py PROFILE FILE`: an achd whose robot walks; prints the source for an agent."""
    from achd_stage import Achd
    from posecast_edge.profile.reader import find_profile, load_profile

    server = Achd()
    Walker(load_profile(find_profile(sys.argv[1])), Path(sys.argv[2]), server.publish)
    print(server.source, flush=True)
    threading.Event().wait()


if __name__ == "__main__":
    main()
