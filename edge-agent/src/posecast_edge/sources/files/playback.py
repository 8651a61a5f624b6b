"""Plays a recording at the pace of its own clock. `schedule_samples` computes when samples are due, `run`
waits.

    KIND:PATH[?start=SECONDS][&loop]   start this many seconds after the beginning; repeat for ever

A gap of more than MAX_PAUSE_S between two samples, or a step back, is skipped. In a loop, robot time
continues from one repetition to the next.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TextIO

from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.base import Deliver, split_options, to_seconds
from posecast_edge.sources.clock import explain_step_back

log = logging.getLogger(__name__)

ENDLESS_LINE = 64 << 20  # characters: a file with a longer line is not a text file
MAX_PAUSE_S = 10.0
MAX_BEHIND_S = 1.0  # after a suspend, continue where it stopped
MIN_WAKE_S = 0.005  # samples of faster recordings are delivered in bursts
LEAST_STEP_S = 1e-3  # from pass to pass: a pass of zero length would loop without end
LONE_STEP_S = 0.1  # from pass to pass of a recording with a single instant


class EndlessLine(ValueError):
    """A file that does not consist of text lines; the text gives the reason."""


@dataclass(frozen=True)
class Playback:
    """Which file to play, from which second, and whether to repeat it."""

    path: Path
    start_s: float = 0.0
    loop: bool = False


class Recording(Protocol):
    """A file of samples that can be read any number of times."""

    description: str

    def read_samples(self, start_s: float, first_pass: bool) -> Iterator[Sample]:
        """Samples in file order, from `start_s` seconds after the first. Problems are logged in the first
        pass only.

        Raises SourceError (one line with file and record) when reading can't continue.
        """


def skip_line(file: TextIO, step: int) -> None:
    """Skip the rest of an overlong line. Raises EndlessLine when the line does not end."""
    skipped = 0
    while rest := file.readline(step):
        if rest.endswith(("\n", "\r")):
            return
        skipped += len(rest)
        if skipped > ENDLESS_LINE:
            raise EndlessLine(f"no end of line within {ENDLESS_LINE >> 20} MiB")


def parse_playback(kind: str, address: str) -> Playback:
    """Parse the text after `KIND:`. Raises SourceError with one line when it is invalid."""
    name, options = split_options(kind, address, {"start": "SECONDS", "loop": ""})
    if not name or "\0" in name:
        raise SourceError(f"{kind}: give a path, such as {kind}:walk.{kind}")
    return Playback(Path(name), to_seconds(kind, "start", options.get("start", "0")), "loop" in options)


class Player:
    """Plays one recording."""

    def __init__(self, recording: Recording, playback: Playback) -> None:
        self.description = recording.description
        self._recording = recording
        self._playback = playback

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver every sample when it is due until the end or `stop`. Raises SourceError when the file can't
        be read."""
        began_s: float | None = None  # set by the first sample: the time to find it is no delay
        for due_s, sample in self.schedule_samples():
            began_s = time.monotonic() if began_s is None else began_s
            behind_s = time.monotonic() - began_s - due_s
            if behind_s > MAX_BEHIND_S:
                began_s += behind_s
            elif behind_s < 0:
                stop.wait(max(MIN_WAKE_S, -behind_s))
            if stop.is_set():
                return
            deliver(sample)

    def schedule_samples(self) -> Iterator[tuple[float, Sample]]:
        """Yield (due time in seconds after the first sample, sample) for every sample."""
        due_s = shift_s = step_s = 0.0
        first_pass, has_stepped_back = True, False
        while True:
            began_s: float | None = None
            previous_s = 0.0
            for sample in self._recording.read_samples(self._playback.start_s, first_pass):
                if began_s is None:
                    began_s = sample.t_s
                elif 0 <= sample.t_s - previous_s <= MAX_PAUSE_S:
                    step_s = sample.t_s - previous_s
                    due_s += step_s
                elif sample.t_s < previous_s and first_pass and not has_stepped_back:
                    has_stepped_back = True
                    log.warning("%s: %s", self.description, explain_step_back(previous_s, sample.t_s))
                previous_s = sample.t_s
                yield due_s, sample._replace(t_s=sample.t_s + shift_s)
            if began_s is None:
                path, start_s = self._playback.path, self._playback.start_s
                raise SourceError(f"{path}: no samples" + (f" after {start_s:g} s" if start_s else ""))
            if not self._playback.loop:
                return
            first_pass = False
            step_s = (
                max(step_s, LEAST_STEP_S) if step_s else LONE_STEP_S
            )  # a pass must take time, or the loop would never wait
            due_s += step_s
            shift_s += max(0.0, previous_s - began_s) + step_s
