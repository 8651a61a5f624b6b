"""`python -m fuzz [--seconds 60] [TARGET …]`, and `python -m fuzz --replay FILE`: one finding once more."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from fuzz.campaign import campaign, load_to_lead
from fuzz.child import LED, patience
from fuzz.corpus import FINDINGS, read_case
from fuzz.target import Finding, Gone, Target, judge


def main() -> int:
    """0 when nothing was found."""
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help="all of them without any")
    parser.add_argument("--seconds", type=float, default=60.0, help="for all of them together")
    parser.add_argument(
        "--replay", type=Path, metavar="FILE", help="a case, in a folder named like its target"
    )
    asked = parser.parse_args()
    targets = load_to_lead()
    if asked.replay is not None:
        return replay(asked.replay, targets)
    chosen = [target for target in targets if not asked.targets or target.name in asked.targets]
    if unknown := set(asked.targets) - {target.name for target in targets}:
        parser.error(f"no target {', '.join(sorted(unknown))}: use {', '.join(t.name for t in targets)}")
    if not LED:
        print("atheris is not installed here: cases are changed at random, led by no coverage")
    began_s = time.monotonic()
    results = campaign(chosen, asked.seconds, FINDINGS)
    executions = sum(result.executions for result in results)
    found = [(result.target.name, *one) for result in results for one in result.findings]
    took_s = time.monotonic() - began_s
    print(f"{executions:,} executions of {len(results)} targets in {took_s:.0f} s, {len(found)} findings")
    for name, what, file in found:
        print(f"{name}: {what[:200]}\n    python -m fuzz --replay {file}")
    return 1 if found else 0


def replay(file: Path, targets: Sequence[Target]) -> int:
    """Say what is wrong with how a case is read; its folder names the target, or several that share it."""
    name = file.resolve().parent.name
    wrong = 0
    for target in targets:
        if name not in (target.name, target.folder):
            continue
        try:
            with patience():
                found = judge(target, read_case(file))
        except Gone as e:
            found = Finding("gone", str(e))
        wrong += found is not None
        said = "nothing wrong" if found is None else f"{found.what}\n{found.detail}"
        print(f"{target.name}: {said}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
