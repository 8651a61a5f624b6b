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

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile
    from posecast_edge.sources.mujoco.model import Simulation


import resource
import sys

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.mjcf.child import REFUSED, limit_child, run_child

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


# --- the trial, in a separate process, `python -m posecast_edge.sources.mujoco.source PATH`: a file may make
# MuJoCo hang, crash or exhaust memory

SECONDS_MAX = 60.0  # to load; a large scene takes a while
MEMORY_MAX = 1 << 30  # bytes of the process once the model is loaded


def check_loads(path: Path) -> None:
    """Raise SourceError (one line) when the model can't be loaded within the limits of time and memory, or
    needs files that don't belong to it."""
    try:
        run_child("posecast_edge.sources.mujoco.source", [str(path)], None, SECONDS_MAX)
    except ModelRefused as e:
        reason = e.reason
        raise SourceError(reason if reason.startswith(f"{path}") else f"{path}: {reason}"[:400]) from None


def main(path: Path) -> int:
    """Load the model and simulate a moment. Returns the exit status; errors go to stderr."""
    limit_child()
    from posecast_edge.sources.mujoco.model import load_simulation  # noqa: PLC0415 - within the bound

    try:
        simulation = load_simulation(path)
        simulation.advance(SAMPLE_S)
        simulation.make_sample()
        size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10
        if size > MEMORY_MAX:
            raise SourceError(f"{path}: needs {size >> 20} MiB of memory, at most {MEMORY_MAX >> 20}")
    except SourceError as e:
        print(e, file=sys.stderr)
        return REFUSED
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
