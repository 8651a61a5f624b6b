"""Runs MuJoCo's compiler in a separate process, because a file may make it hang, crash or use all memory."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import IO

from posecast_edge.model.finding import ModelRefused

SECONDS_MAX = 60.0  # to load, by the clock
CPU_S = 20  # of the processor; large robots take two
ASKED_MAX = 2 << 30  # bytes that the process may ask for
ANSWER_MAX = 256 << 20  # bytes that it may write
OUTPUT_MAX = 1 << 16  # bytes of its last output that are read
# fewer threads leave more memory for the model; freed memory is returned to the system
LEAN = {"OPENBLAS_NUM_THREADS": "1", "MALLOC_TRIM_THRESHOLD_": "65536", "MALLOC_MMAP_THRESHOLD_": "65536"}
REFUSED = 1  # exit status after reporting a reason


def run_child(module: str, arguments: Sequence[str], answer: IO[bytes] | None, seconds_max: float) -> None:
    """Run `python -m module arguments…` with stdout to the file `answer`.

    Raises ModelRefused with its last line on stderr when it ends with REFUSED, otherwise with how it ended.
    """
    command = [sys.executable, "-m", module, *arguments]
    try:
        tried = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL if answer is None else answer,
            stderr=subprocess.PIPE,
            timeout=seconds_max,
            check=False,
            env={**os.environ, **LEAN},
        )
    except subprocess.TimeoutExpired:
        raise ModelRefused(f"not loaded within {seconds_max:g} s") from None
    if tried.returncode:
        refusal = tried.stderr[-OUTPUT_MAX:].decode("utf-8", "replace").strip().rpartition("\n")[2]
        if tried.returncode == REFUSED and refusal:
            raise ModelRefused(refusal)
        if tried.returncode == -signal.SIGXCPU:
            raise ModelRefused(f"not loaded within {CPU_S} s of CPU time")
        raise ModelRefused(f"MuJoCo crashed on it ({tried.returncode})")


def limit_child() -> None:
    """Limit this process's memory, CPU time and written bytes. Called at a child's start."""
    resource.setrlimit(resource.RLIMIT_DATA, (ASKED_MAX, ASKED_MAX))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 1))
    resource.setrlimit(resource.RLIMIT_FSIZE, (ANSWER_MAX, ANSWER_MAX))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


@contextmanager
def open_no_file() -> Iterator[None]:
    """Within this block the process can't open files: MuJoCo gets only the files passed to it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
