"""Source `mujoco[:MODEL]`: a robot simulated with MuJoCo (the extra `mujoco`), if you have no real one.

MODEL is MJCF (.xml) or URDF; the default is a built-in arm. The robot moves like this:

* with keyframes that set controls, from one keyframe to the next;
* otherwise one servo-held joint after the other, a little way and back.

`ref` is the target of the position servos. `pos`, `vel` and `effort` are those of the joints, `base` and
`baseq` the pose of a free joint. `acc`, `gyro`, `quat`, `ftf` and `ftm` are the model's sensors, by site.
"""

from __future__ import annotations

import logging
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

from posecast_wire.command_line.installation import advise_extra

from posecast_edge.model.robot_file import find_format
from posecast_edge.sample import SourceError
from posecast_edge.sources.base import Defaults, Deliver, Source
from posecast_edge.sources.mujoco.trial import check_loads

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile
    from posecast_edge.sources.mujoco.model import Simulation

log = logging.getLogger("posecast_edge.mujoco")

PACKAGE = Path(__file__).resolve().parents[2]
ARM = PACKAGE / "simulated" / "arm.urdf"
ARM_PROFILE = PACKAGE / "profiles" / "arm.toml"
SAMPLE_S = 0.01  # of simulated and of real time
MAX_BEHIND_S = 0.5  # a model too heavy for this machine runs slower than real time, without a backlog


def find_defaults(address: str) -> Defaults:
    """The simulated model as the shown model, if it is URDF or MJCF."""
    if not address:
        return Defaults(ARM_PROFILE, ARM)
    path = Path(address)
    shown = path.suffix.lower() == ".urdf" or find_format(path) == "mjcf"
    return Defaults(urdf=path if shown else None)


def open_source(address: str, profile: Profile | None) -> Source:
    """Load the model. Raises SourceError (one line) when MuJoCo is missing or refuses the model."""
    del profile  # labels are matched later, for samples of every source
    try:
        from posecast_edge.sources.mujoco.model import load_simulation  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as e:
        if e.name != "mujoco":
            raise
        raise SourceError(f"mujoco: not installed; {advise_extra('posecast-edge', 'mujoco')}") from None
    path = Path(address) if address else ARM
    if address:
        check_loads(path)
    simulation = load_simulation(path)
    rest = simulation.explain_rest()
    if rest:
        log.info("mujoco %s: %s", path.name, rest)
    return MujocoSource(simulation, path.name)


class MujocoSource:
    """Runs a simulation in real time."""

    def __init__(self, simulation: Simulation, name: str) -> None:
        self.description = f"mujoco {name}"
        self._simulation = simulation

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver a sample every SAMPLE_S of simulated time until `stop`."""
        began_s, is_reported = time.monotonic(), False
        while not stop.is_set():
            self._simulation.advance(SAMPLE_S)
            deliver(self._simulation.make_sample())
            ahead_s = began_s + self._simulation.t_s - time.monotonic()
            if ahead_s > 0:
                stop.wait(ahead_s)
            elif -ahead_s > MAX_BEHIND_S:
                began_s -= ahead_s
                if not is_reported:
                    is_reported = True
                    log.warning("%s: slower than real time on this machine", self.description)
