"""Writes what is exported as one file of another format: CSV or MCAP."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO, Literal

from posecast_relay.export.csv_file import write_csv
from posecast_relay.export.held_time import HeldTime
from posecast_relay.export.mcap_file import write_mcap
from posecast_relay.export.span import ExportedSpan
from posecast_relay.export.table import TableReader

TableFormat = Literal["csv", "mcap"]


@dataclass(frozen=True)
class WrittenTable:
    """What was written. `frames`: how many; `held`: of which time; `warnings`: a line for what was passed
    over, and one for each other thing that is not in the file, without a full stop."""

    frames: int
    held: HeldTime
    warnings: Sequence[str]


def write_table(file: BinaryIO, kind: TableFormat, span: ExportedSpan) -> WrittenTable:
    """Write the frames that were accepted in the span (and in MCAP the events), and return what there was.
    What can't be read is passed over. Raises OSError, TooManyColumnsError,
    TooManyTopicsError, and McapMissingError without the extra `export`."""
    table = TableReader(span.read_segments(), span.recording.schemas, span.from_ms, span.to_ms)
    frames = write_csv(file, table) if kind == "csv" else write_mcap(file, table, span.find_model_file)
    return WrittenTable(frames, table.held, table.losses.describe())
