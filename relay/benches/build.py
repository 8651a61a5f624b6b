"""Compiles the bench's C programs into out/bench/; `python -m relay.benches.build` prints where they are."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
OUT = ROOT / "out" / "bench"  # ignored by git
PROGRAMS = ("viewers", "bare_server")


class NoCompiler(Exception):
    """One line for people."""


def build(out: Path = OUT) -> dict[str, Path]:
    """Program name → binary. NoCompiler when there is none, or when it refuses the sources."""
    compiler = shutil.which(os.environ.get("CC", "cc"))
    if compiler is None:
        raise NoCompiler("bench: needs a C compiler (cc); on Debian: apt-get install gcc libc6-dev")
    out.mkdir(parents=True, exist_ok=True)
    for name in PROGRAMS:
        command = [compiler, "-O2", "-Wall", "-Wextra", "-o", str(out / name), str(HERE / f"{name}.c")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise NoCompiler(f"bench: {compiler} could not compile {name}.c:\n{done.stderr}")
    return {name: out / name for name in PROGRAMS}


def main() -> int:
    try:
        for name, path in build().items():
            print(name, path)
    except NoCompiler as e:
        print(e, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
