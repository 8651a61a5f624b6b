"""Assigns the columns of a trajectory file to fields and channels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from posecast_wire.mapping import JOINT

if TYPE_CHECKING:
    from posecast_edge.profile.types import FieldSpec


class Columns:
    """Looks up the field and channel of columns, in time independent of the number of channels."""

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
        """The (field, channel index) that a column's name stands for, or None: a joint's name belongs to
        `ref` (to `pos` if the profile has no `ref`), `FIELD.LABEL` to that field.

        In a field with one site the component is enough: `baseq.w` is `base.w` in `baseq`.
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
    """Look up a single column; see Columns.find."""
    return Columns(fields).find(column)
