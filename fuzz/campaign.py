"""All targets, side by side, for so long; and what they found."""

from __future__ import annotations

import contextlib
import importlib
import json
import logging
import os
import re
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

from fuzz.child import RSS_MB, Run, watched
from fuzz.corpus import cases, keep, read_case
from fuzz.page_reader import bundled
from fuzz.target import Finding, Target

FAMILIES = (
    "fuzz.targets.wire",
    "fuzz.targets.relay",
    "fuzz.targets.export",
    "fuzz.targets.archive",
    "fuzz.targets.sources",
    "fuzz.targets.models",
    "fuzz.targets.page",
)
# packages whose code leads
LEADING = ("posecast_wire", "posecast_relay", "posecast_edge")
LEAST_S = 0.5  # for a target
GRACE_S = 90.0  # after which a process that does not end is ended
DEATHS_MAX = 5  # of one target's process


@dataclass
class Result:
    """What one target did. `covered`: by the seeds; `new`: what was found beyond."""

    target: Target
    executions: int = 0
    covered: int = 0
    new: int = 0
    findings: list[tuple[str, Path]] = field(default_factory=list)  # what, and the case's file


def load(families: Sequence[str] = FAMILIES) -> list[Target]:
    """Every target of these modules."""
    return [target for name in families for target in importlib.import_module(name).TARGETS]


def load_to_lead(families: Sequence[str] = FAMILIES, leading: Sequence[str] = LEADING) -> list[Target]:
    """Likewise, for a process that does nothing else: nothing is said, and what their readers do leads."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ[name] = "1"
    warnings.simplefilter("ignore")
    logging.disable(logging.CRITICAL)
    with quiet(), watched(leading):
        return load(families)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """atheris names every module that it instruments."""
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stderr(nowhere):
        yield


def campaign(
    targets: Sequence[Target], seconds: float, findings: Path, out: TextIO = sys.stdout
) -> list[Result]:
    """Every target for an equal part of `seconds`, as many at a time as there are processors."""
    at_once = os.cpu_count() or 1
    share_s = max(LEAST_S, seconds * min(at_once, len(targets)) / max(1, len(targets)))
    if any(target.page for target in targets):
        bundled()
    results = {target.name: Result(target) for target in targets}
    waiting = [(target, share_s, 0) for target in reversed(targets)]
    running: dict[int, tuple[Target, float, int, Path]] = {}
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        while waiting or running:
            while waiting and len(running) < at_once:
                target, left_s, deaths = waiting.pop()
                place = Path(folder) / f"{target.name}-{deaths}"
                place.mkdir()
                pid = _start(target, left_s, place, findings)
                running[pid] = (target, time.monotonic() + left_s, deaths, place)
            pid, status = _ended(running)
            if pid == 0:
                time.sleep(0.02)
                continue
            target, ends_s, deaths, place = running.pop(pid)
            result = results[target.name]
            _collect(result, place, status, findings)
            left_s = ends_s - time.monotonic()
            if status and left_s > LEAST_S and deaths < DEATHS_MAX:
                waiting.append((target, left_s, deaths + 1))
            else:
                print(_row(result, share_s), file=out, flush=True)
    return list(results.values())


def _start(target: Target, seconds: float, place: Path, findings: Path) -> int:
    pid = os.fork()
    if pid:
        return pid
    log = os.open(place / "log", os.O_CREAT | os.O_WRONLY, 0o644)
    os.dup2(log, 1)
    os.dup2(log, 2)
    tempfile.tempdir = str(place)  # a process that ends at once leaves nothing behind
    try:
        seeds = [*target.seeds, *(read_case(file) for file in cases(target.folder))]
        Run(target, seeds, seconds, place, findings).go()
    finally:
        sys.excepthook(*sys.exc_info())
        os._exit(1)


def _ended(running: dict[int, tuple[Target, float, int, Path]]) -> tuple[int, int]:
    for pid, (_, ends_s, _, _) in running.items():
        found, status = os.waitpid(pid, os.WNOHANG)
        if found:
            return pid, status
        if time.monotonic() > ends_s + GRACE_S:
            os.kill(pid, signal.SIGKILL)
    return 0, 0


def _collect(result: Result, place: Path, status: int, findings: Path) -> None:
    log = (place / "log").read_text("utf-8", "replace")
    counted = place / "executions"
    numbers = [int(n) for n in re.findall(r"^#(\d+)\t", log, re.MULTILINE)]
    result.executions += int(counted.read_text()) if counted.exists() else max(numbers, default=0)
    covered = [int(n) for n in re.findall(r"^#\d+\t.* cov: (\d+)", log, re.MULTILINE)]
    first = re.search(r"INITED cov: (\d+)", log)
    if first and covered:
        result.covered = int(first[1])
        result.new = max(covered) - result.covered
    said = place / "findings"
    for line in said.read_text().splitlines() if said.exists() else ():
        _, what, file = json.loads(line)
        result.findings.append((what, Path(file)))
    if status:
        died = next(iter(place.glob("died-*")), None)
        data = died.read_bytes() if died else b""
        how = (
            f"over {RSS_MB} MB"
            if "oom" in str(died)
            else "hangs"
            if "timeout" in str(died)
            else "its process died"
        )
        finding = Finding(how, how, log[-4000:])
        result.findings.append((how, keep(result.target.name, data, finding, findings)))


def _row(result: Result, share_s: float) -> str:
    rate = result.executions / share_s
    return (
        f"{result.target.name:<18}{result.executions:>10,} executions {rate:>9,.0f}/s"
        f"   coverage {result.covered:>5} +{result.new:<5}  findings {len(result.findings)}"
    )
