"""Source `trajectory:PATH`: plays a text file of joint angles, one row per time step, for ever.

The profile's [trajectory] sets the columns, the rate and the unit. Columns are separated by spaces, commas or
semicolons. The angles become `ref`; `pos` follows them like a servo, with a first-order lag. An invalid row
is logged (in the first pass) and skipped, but its time step still passes. The file is read while it plays and
never held in memory.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from posecast_edge.kit import PartLog, kind_of
from posecast_edge.profile.types import find_column
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.base import Deliver, Source
from posecast_edge.sources.files.playback import EndlessLine, skip_line

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile, Trajectory

log = logging.getLogger("posecast_edge.trajectory")

MAX_LINE = 64 * 1024  # characters
MAX_BAD_START = 1000  # rows looked at to find one that fits
MIN_WAKE_S = 0.01  # rows of faster files are read in batches, of which only the newest is delivered
MAX_BEHIND_S = 1.0  # after a suspend, continue where it stopped
SKIP = "-"

Row = list[float]


class RowError(ValueError):
    """A line that is not a valid row; the text gives the reason."""


def open_source(address: str, profile: Profile | None) -> Source:
    """Open a file. Raises SourceError without a path, a profile with [trajectory], or at least one valid
    row."""
    if not address:
        raise SourceError("trajectory: give a path, such as trajectory:walk.traj")
    if profile is None or profile.trajectory is None:
        raise SourceError("trajectory: give a profile with a [trajectory] table (--profile)")
    return TrajectorySource(Path(address), profile, profile.trajectory)


def parse_row(line: str, columns: int) -> Row:
    """Parse a line into numbers. Raises RowError when their count is not `columns` or one is not a finite
    number."""
    if len(line) > MAX_LINE:
        raise RowError(f"over {MAX_LINE} characters")
    words = line.replace(",", " ").replace(";", " ").split()
    row = []
    for i, word in enumerate(words[:columns]):
        try:
            row.append(float(word))
        except ValueError:
            raise RowError(f"column {i + 1}: {word[:40]!r} is not a number") from None
        if not math.isfinite(row[-1]):
            raise RowError(f"column {i + 1}: {word[:40]!r} is not an angle")
    if len(words) != columns:
        raise RowError(f"{len(words)} columns, {columns} expected")
    return row


class TrajectorySource:
    """Plays one file. `advance` decides what is delivered, `run` waits until it is due."""

    def __init__(self, path: Path, profile: Profile, trajectory: Trajectory) -> None:
        self.description = f"trajectory {path.name}, {trajectory.rate_hz:g} Hz"
        self._path = path
        self._trajectory = trajectory
        self._bad = PartLog(log.warning, "bad rows")
        self._file = self._open()
        self._columns = self._count_columns()
        self._pose = TrajectoryPose(profile, trajectory, self._columns)
        self._rows = self._play()
        self._index = -1  # of the newest row taken, over all passes

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver samples until `stop`. Raises SourceError when reading the file fails."""
        with self._file:
            start_s = time.monotonic()
            while not stop.is_set():
                elapsed_s = time.monotonic() - start_s
                behind_s = elapsed_s - self.next_s
                if behind_s > MAX_BEHIND_S:
                    start_s += behind_s
                    elapsed_s -= behind_s
                sample = self.advance(elapsed_s)
                if sample is not None:
                    deliver(sample)
                stop.wait(max(MIN_WAKE_S, start_s + self.next_s - time.monotonic()))

    @property
    def next_s(self) -> float:
        """When the next row is due, in seconds after the first."""
        return (self._index + 1) / self._trajectory.rate_hz

    def advance(self, elapsed_s: float) -> Sample | None:
        """Read every row due by `elapsed_s` seconds. Returns the newest as a sample, or None when no row was
        due."""
        moved = False
        while self.next_s <= elapsed_s:
            self._index += 1
            row = next(self._rows)
            if row is not None:
                self._pose.apply_row(row)
                moved = True
        return Sample(self._index / self._trajectory.rate_hz, self._pose.copy_values()) if moved else None

    def _open(self) -> TextIO:
        try:
            return open(self._path, encoding="utf-8-sig", errors="replace")
        except OSError as e:
            raise SourceError(f"{self._path}: {e.strerror or e}") from None

    def _lines(self) -> Iterator[tuple[int, str]]:
        """Lines that should be rows, with their number, from the start of the file to its end."""
        try:
            self._file.seek(0)
            number = 0
            while line := self._file.readline(MAX_LINE + 1):
                number += 1
                if not line.endswith("\n"):
                    skip_line(self._file, MAX_LINE)
                if number > self._trajectory.header and line.strip():
                    yield number, line
        except OSError as e:
            raise SourceError(f"{self._path}: {e.strerror or e}") from None
        except EndlessLine as e:
            raise SourceError(f"{self._path}:{number}: {e}") from None

    def _count_columns(self) -> int:
        """The number of columns in the first valid row, which the whole file must have."""
        most, fewest = len(self._trajectory.columns), self._trajectory.fewest
        first = ""
        for _, (number, line) in zip(range(MAX_BAD_START), self._lines(), strict=False):
            columns = len(line.replace(",", " ").replace(";", " ").split())
            try:
                parse_row(line, fewest if columns == fewest else most)
                return columns
            except RowError as e:
                first = first or f"{self._path}:{number}: {e}"
        self._file.close()
        raise SourceError(f"no row fits the profile: {first}" if first else f"{self._path}: no rows")

    def _play(self) -> Iterator[Row | None]:
        """Yield rows for ever; None for an invalid one. Raises SourceError when the file was emptied."""
        first_pass = some = True
        while some:
            some = False
            for number, line in self._lines():
                some = True
                try:
                    row = parse_row(line, self._columns)
                except RowError as e:
                    if first_pass:
                        self._bad.add(kind_of(str(e)), f"{self._path}:{number}: {e}; row skipped")
                    yield None
                    continue
                yield row
            self._bad.flush()
            first_pass = False
        raise SourceError(f"{self._path}: the file has no more rows")


class TrajectoryPose:
    """The current pose: takes rows and gives the values of the profile's fields."""

    def __init__(self, profile: Profile, trajectory: Trajectory, columns: int) -> None:
        self._values: dict[str, list[float | None]] = {}
        self._targets: list[tuple[int, list[float | None], int, float]] = []  # column, values, channel, gain
        for i, column in enumerate(trajectory.columns[:columns]):
            found = None if column == SKIP else find_column(profile.fields, column)
            if found is None:
                continue
            name, channel = found
            spec = profile.find_field(name)
            assert spec is not None
            values = self._values.setdefault(name, [None] * len(spec.labels))
            degrees = trajectory.unit == "deg" and name in ("ref", "pos")
            self._targets.append((i, values, channel, math.pi / 180 if degrees else 1.0))
        self._ref = self._values.get("ref")
        self._pos: list[float | None] | None = None
        if self._ref is not None and profile.find_field("pos") is not None:
            self._pos = self._values["pos"] = [None] * len(self._ref)
        step_s = 1 / trajectory.rate_hz
        self._gain = 1.0 if trajectory.lag_s == 0 else -math.expm1(-step_s / trajectory.lag_s)

    def apply_row(self, row: Row) -> None:
        """Advance by one time step: set `ref` to the row and move `pos` towards it."""
        for column, values, channel, gain in self._targets:
            values[channel] = row[column] * gain
        if self._ref is not None and self._pos is not None:
            for i, ref in enumerate(self._ref):
                pos = self._pos[i]
                self._pos[i] = ref if ref is None or pos is None else pos + self._gain * (ref - pos)

    def copy_values(self) -> dict[str, list[float | None]]:
        """A copy of the current values, which does not change with the next row."""
        return {name: list(values) for name, values in self._values.items()}
