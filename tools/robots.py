"""Builds every robot in a folder, each in a process of its own, and says what came of it.

`python -m tools.robots FOLDER…` (or the folders in POSECAST_ROBOTS). A robot is a URDF, a xacro, an SDF or an
MJCF, found by what stands in the file. Each builds, or is refused in one line, within the processor's time
and the memory that it is allowed; else the exit status is 1.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

SUFFIXES = (".urdf", ".xacro", ".sdf", ".xml")
ROOT = re.compile(rb"<(robot|sdf|mujoco)[\s>]")
HEAD = 1 << 16  # bytes looked at for the root element
KILLED_S = 300
STATUS = {0: "built", 1: "stand-ins", 2: "refused"}


@dataclass(frozen=True)
class Outcome:
    """What came of one robot."""

    file: Path
    status: int
    took_s: float
    memory_mb: float
    said: tuple[str, ...]

    def find_fault(self, seconds: float, memory_mb: float) -> str:
        """What is wrong with it; "" when nothing is."""
        if self.status not in STATUS:
            return f"ended with status {self.status}"
        if self.status == 2 and len(self.said) != 1:
            return f"refused in {len(self.said)} lines"
        if self.took_s > seconds:
            return f"took more than {seconds:g} s"
        return f"took more than {memory_mb:g} MB" if self.memory_mb > memory_mb else ""


def list_robots(folders: Sequence[Path]) -> Iterator[Path]:
    """The files that describe a robot, also those that are named as files."""
    for folder in folders:
        for file in sorted(folder.rglob("*")) if folder.is_dir() else [folder]:
            if file.suffix.lower() in SUFFIXES and file.is_file():
                with file.open("rb") as source:
                    found = ROOT.search(source.read(HEAD))
                if found is not None and (file.suffix.lower() != ".xml" or found[1] == b"mujoco"):
                    yield file


def build_robot(file: Path, packages: Sequence[Path]) -> Outcome:
    """Build one, with a look at what its process took."""
    with tempfile.TemporaryDirectory() as out, tempfile.TemporaryFile("w+") as said:
        command = [sys.executable, "-m", "posecast_edge", "model", "build", "--no-cache", str(file)]
        command += ["-o", f"{out}/bundle", *(f"--package-path={p}" for p in packages)]
        process = subprocess.Popen(
            ["timeout", str(KILLED_S), *command], stdout=subprocess.DEVNULL, stderr=said
        )
        _, status, used = os.wait4(process.pid, 0)
        said.seek(0)
        lines = tuple(said.read().splitlines())
    return Outcome(
        file, os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, lines
    )


def main() -> int:
    """Entry point; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    given = [p for p in os.environ.get("POSECAST_ROBOTS", "").split(os.pathsep) if p]
    parser.add_argument("folders", type=Path, nargs="*", default=list(map(Path, given)))
    parser.add_argument("--package-path", type=Path, action="append", default=[])
    parser.add_argument(
        "--seconds", type=float, default=10.0, help="of the processor, that one may take (10)"
    )
    parser.add_argument("--memory", type=float, default=300.0, help="MB that one may take (300)")
    args = parser.parse_args()
    if not args.folders:
        parser.error("name a folder, or several in POSECAST_ROBOTS")
    faults, counts = 0, dict.fromkeys(STATUS.values(), 0)
    for file in list_robots(args.folders):
        made = build_robot(file, args.package_path)
        word, fault = STATUS.get(made.status, "failed"), made.find_fault(args.seconds, args.memory)
        counts[word] = counts.get(word, 0) + 1
        faults += bool(fault)
        told = fault or (made.said[-1].partition(f"{file}")[2].lstrip(": ") if made.status else "")
        print(f"{word:10}{made.took_s:6.1f} s{made.memory_mb:6.0f} MB  {file}  {told}", flush=True)
    print(", ".join(f"{n} {word}" for word, n in counts.items() if n), f"- {faults} at fault")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
