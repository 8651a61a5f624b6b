"""Loads a model in a separate process first, because a file may make MuJoCo hang, crash or exhaust memory.
`python -m posecast_edge.sources.mujoco.trial PATH`"""

from __future__ import annotations

import resource
import sys
from pathlib import Path

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.mjcf.child import REFUSED, limit_child, run_child
from posecast_edge.sample import SourceError

SECONDS_MAX = 60.0  # to load; a large scene takes a while
MEMORY_MAX = 1 << 30  # bytes of the process once the model is loaded
SAMPLE_S = 0.01


def check_loads(path: Path) -> None:
    """Raise SourceError (one line) when the model can't be loaded within the limits of time and memory, or
    needs files that don't belong to it."""
    try:
        run_child("posecast_edge.sources.mujoco.trial", [str(path)], None, SECONDS_MAX)
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
