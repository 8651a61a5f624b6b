"""Loads a model in a separate process first: a file may make MuJoCo hang, crash or exhaust the memory.
`python -m posecast_edge.sources.mujoco.trial PATH`"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

from posecast_edge.sample import SourceError

SECONDS_MAX = 60.0  # to load; a large scene takes some
MEMORY_MAX = 1 << 30  # bytes that the process has when it is loaded
ASKED_MAX = 2 << 30  # bytes that it may ask for meanwhile
SAMPLE_S = 0.01


def check_loads(path: Path) -> None:
    """Raise SourceError with one line when the model can't be loaded within the bounds on time and memory."""
    command = [sys.executable, "-m", "posecast_edge.sources.mujoco.trial", str(path)]
    try:
        tried = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=SECONDS_MAX,
            check=False,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # each takes memory that the model could have
        )
    except subprocess.TimeoutExpired:
        raise SourceError(f"{path}: not loaded within {SECONDS_MAX:g} s") from None
    if tried.returncode:
        said = tried.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2]
        what = said if tried.returncode == 1 and said else f"MuJoCo crashed on it ({tried.returncode})"
        raise SourceError(what if what.startswith(f"{path}") else f"{path}: {what}"[:400])


def main(path: Path) -> int:
    """Load the model and simulate a moment. Returns the exit status; errors go to stderr."""
    resource.setrlimit(resource.RLIMIT_DATA, (ASKED_MAX, ASKED_MAX))
    from posecast_edge.sources.mujoco.model import load_simulation  # noqa: PLC0415 - within the bound

    try:
        simulation = load_simulation(path)
        simulation.advance(SAMPLE_S)
        simulation.make_sample()
        size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10
        if size > MEMORY_MAX:
            raise SourceError(f"{path}: takes {size >> 20} MiB, at most {MEMORY_MAX >> 20}")
    except SourceError as e:
        print(e, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
