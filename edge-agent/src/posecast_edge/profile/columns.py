"""What a column of a trajectory file means: which field, which channel of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from posecast_wire.mapping import JOINT

if TYPE_CHECKING:
    from posecast_edge.profile.types import FieldSpec


class Columns:
    """Where each column of a file goes, however many there are."""

    def __init__(self, fields: Sequence[FieldSpec]) -> None:
        joints = [f for name in ("ref", "pos") for f in fields if f.name == name and f.label_set == JOINT]
        self._joints = (
            {label: (joints[0].name, i) for i, label in enumerate(joints[0].labels)} if joints else {}
        )
        self._channels: dict[str, dict[str, int | None]] = {}
        for field in fields:
            if field.name not in self._channels:
                self._channels[field.name] = _endings(field.labels)

    def find(self, column: str) -> tuple[str, int] | None:
        """(field, channel) of a column: a joint's name is in ref, `FIELD.LABEL` in that field.

        A field with one site needs the component alone: `baseq.w` is `base.w` in `baseq`.
        None when there is no such channel. Without a field `ref` the joints go to `pos`.
        """
        if column in self._joints:
            return self._joints[column]
        name, _, rest = column.partition(".")
        channel = self._channels.get(name, {}).get(rest)
        return None if channel is None else (name, channel)


def _endings(labels: Sequence[str]) -> dict[str, int | None]:
    """Label, and what of it stands after its site → its channel; None where several would do."""
    found: dict[str, int | None] = {}
    for i, label in enumerate(labels):
        for ending in {label, label.partition(".")[2]}:
            found[ending] = None if ending in found else i
    return found


def find_column(fields: Sequence[FieldSpec], column: str) -> tuple[str, int] | None:
    """As Columns.find, of a single column."""
    return Columns(fields).find(column)
