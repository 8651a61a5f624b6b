"""The agent's commands as processes, forked off one that has loaded the agent already."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(["posecast_edge.cli.main", "posecast_edge.cli.model_command"])


def _become_edge(argv: Sequence[str], env: Mapping[str, str], folder: str) -> None:
    for number, name in enumerate((os.devnull, f"{folder}/out", f"{folder}/err")):
        file = os.open(name, os.O_RDWR | os.O_CREAT)
        os.dup2(file, number)
        os.close(file)
    sys.stdin, sys.stdout, sys.stderr = (os.fdopen(n, "w" if n else "r", closefd=False) for n in range(3))
    os.environ.clear()
    os.environ.update(env)
    from posecast_edge.cli.main import main

    main(argv)


def run_edge(*argv: str, env: Mapping[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """`posecast-edge` with these arguments and an empty stdin, to its end (120 s at most)."""
    with tempfile.TemporaryDirectory() as folder:
        environment = dict(os.environ if env is None else env)
        process = FORKS.Process(target=_become_edge, args=(argv, environment, folder))
        process.start()
        process.join(120)
        if process.exitcode is None:
            process.kill()
            process.join()
        out, err = (Path(folder, name).read_text(encoding="utf-8") for name in ("out", "err"))
        return subprocess.CompletedProcess(argv, process.exitcode or 0, out, err)
