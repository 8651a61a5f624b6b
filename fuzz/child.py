"""One target in a process of its own: first its cases' costs, then what coverage leads to."""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from types import FrameType

from fuzz.corpus import keep
from fuzz.mutate import changed, stretched
from fuzz.target import CLOCK, Finding, Gone, Target, judge, spent_s

try:
    import atheris
except ModuleNotFoundError:
    atheris = None

LED = atheris is not None
STRETCHING = 0.25  # of the time
A_MOMENT = 0.04  # of that
HALVINGS = 6  # of the longest case: with what it begins
GROWTH = 16
NOISE = 4  # 16 times as long may take 64 times as long, as caches have it; with the square it takes 256
LEAST_S = 0.001  # below it a clock says little
PATIENCE_S = 60  # what takes longer has hung
RSS_MB = 2048
KINDS_MAX = 20  # of one target: more are the same
SHRINKING_S = 0.5


class Run:
    """What one target did. `folder`: takes its log, its counts and what libFuzzer writes."""

    def __init__(
        self, target: Target, seeds: list[bytes], seconds: float, folder: Path, findings: Path
    ) -> None:
        self._target = target
        self._seeds = seeds or [b"a 1\n"]
        self._ends_s = time.monotonic() + seconds
        self._folder = folder
        self._findings = findings
        self._chance = random.Random()
        self._kinds: set[str] = set()
        self._executions = 0

    def go(self) -> None:
        """Until the time is over; does not return."""
        for seed in self._seeds:
            with patience():
                self._take(seed)
        now_s = time.monotonic()
        self._stretch(now_s + STRETCHING * (self._ends_s - now_s))
        if not LED:
            self._change_until(self._ends_s)
        else:
            self._be_led()
        self._end()

    def _stretch(self, until_s: float) -> None:
        """Cases that grow: does what they cost grow faster? Short ones first, longer ones as time allows."""
        moment_s = (until_s - time.monotonic()) * A_MOMENT
        halvings = HALVINGS
        while (began_s := time.monotonic()) < until_s:
            seed = self._chance.choice(self._seeds)
            size = max(self._target.stretched >> halvings, 2 * GROWTH * len(seed))
            if size > self._target.stretched:
                continue  # what stands in the seed itself would hide what grows
            how = stretched(seed, self._chance)
            short, long = how.to(size // GROWTH), how.to(size)
            with patience():
                short_s = spent_s(self._target, short)
                before_s = CLOCK.now_s()
                self._take(long)
                long_s = CLOCK.now_s() - before_s
                self._executions += 1
                if long_s > allowed_s(short, long, short_s) and grows_faster(self._target, short, long):
                    self._note(long, Finding("growth", f"{len(short):,} to {len(long):,} bytes: {how}"))
            quick = time.monotonic() - began_s < moment_s
            halvings = max(0, halvings - 1) if quick else min(HALVINGS, halvings + 1)

    def _change_until(self, until_s: float) -> None:
        """Without coverage: seeds, changed."""
        while time.monotonic() < until_s:
            data = self._chance.choice(self._seeds)
            with patience():
                self._take(changed(data, self._seeds, self._target.longest, self._chance))

    def _be_led(self) -> None:
        """libFuzzer, led by coverage."""
        corpus = self._folder / "corpus"
        corpus.mkdir(exist_ok=True)
        for i, seed in enumerate(self._seeds):
            (corpus / str(i)).write_bytes(seed[: self._target.longest])

        def one(data: bytes) -> None:
            if time.monotonic() > self._ends_s:
                self._end()
            self._take(data)

        def mutate(data: bytes, most: int, seed: int) -> bytes:
            chance = random.Random(seed)
            if chance.random() < 0.5:
                return bytes(atheris.Mutate(data, most))
            return changed(data, self._seeds, most, chance)

        options: dict[str, object] = {
            "timeout": PATIENCE_S,
            "rss_limit_mb": RSS_MB,
            "max_len": self._target.longest,
        }
        options |= {"artifact_prefix": f"{self._folder}/died-", "detect_leaks": 0, "report_slow_units": 1000}
        arguments = [f"-{name}={value}" for name, value in options.items()]
        atheris.Setup([sys.argv[0], *arguments, str(corpus)], one, custom_mutator=mutate)
        atheris.Fuzz()

    def _take(self, data: bytes) -> None:
        self._executions += 1
        try:
            found = judge(self._target, data)
        except Gone as e:
            found = Finding("gone", str(e))
        if found is not None:
            self._note(data, found)

    def _note(self, data: bytes, found: Finding) -> None:
        if found.kind in self._kinds or len(self._kinds) >= KINDS_MAX:
            return
        self._kinds.add(found.kind)
        if found.kind not in ("cost", "growth", "memory", "gone"):
            data = shrunk(self._target, data, found)
        file = keep(self._target.name, data, found, self._findings)
        with (self._folder / "findings").open("a") as out:
            out.write(json.dumps([found.kind, found.what, str(file)]) + "\n")

    def _end(self) -> None:
        (self._folder / "executions").write_text(str(self._executions))
        sys.stderr.flush()
        os._exit(0)


def watched(packages: Sequence[str]) -> AbstractContextManager[object]:
    """What is imported of these packages meanwhile leads libFuzzer."""
    return atheris.instrument_imports(include=list(packages)) if LED else nullcontext()


def allowed_s(short: bytes, long: bytes, short_s: float) -> float:
    """What the long one may take where the short one took so long."""
    return NOISE * len(long) / max(1, len(short)) * max(LEAST_S, short_s)


def grows_faster(target: Target, short: bytes, long: bytes) -> bool:
    """Whether what a case costs grows faster than its length. The least of some measurements counts."""
    short_s = max(spent_s(target, short) for _ in range(3))
    return min(spent_s(target, long) for _ in range(3)) > allowed_s(short, long, short_s)


@contextmanager
def patience(seconds: float = PATIENCE_S) -> Iterator[None]:
    """Gone is raised in whatever takes longer. (libFuzzer has a clock of its own.)"""

    def hung(_number: int, _frame: FrameType | None) -> None:
        raise Gone(f"hangs for {seconds:g} s")

    before = signal.signal(signal.SIGALRM, hung)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def shrunk(target: Target, data: bytes, found: Finding) -> bytes:
    """A shorter case that fails in the same way, as far as it is found in a moment."""
    until_s = time.monotonic() + SHRINKING_S
    size = len(data) // 2
    while size and time.monotonic() < until_s:
        at = 0
        while at < len(data) and time.monotonic() < until_s:
            without = data[:at] + data[at + size :]
            again = judge(target, without)
            if again is not None and again.kind == found.kind:
                data = without
            else:
                at += size
        size //= 2
    return data
