"""Assigns the columns of a trajectory file to fields and channels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from posecast_wire.schema import JOINT

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
        """The (field, channel index) of the column with this name, or None. A joint's name means its channel
        in `ref` (in `pos` if the profile has no `ref`); `FIELD.LABEL` means that field.

        In a field with one site the component is enough: `baseq.w` means `base.w` in `baseq`.
        """
        if column in self._joints:
            return self._joints[column]
        name, _, rest = column.partition(".")
        channel = self._channels.get(name, {}).get(rest)
        return None if channel is None else (name, channel)


def _endings(labels: Sequence[str]) -> dict[str, int | None]:
    """Label, or its part after the site → its channel; None where it is ambiguous."""
    found: dict[str, int | None] = {}
    for i, label in enumerate(labels):
        for ending in {label, label.partition(".")[2]}:
            found[ending] = None if ending in found else i
    return found


def find_column(fields: Sequence[FieldSpec], column: str) -> tuple[str, int] | None:
    """Look up a single column; see Columns.find."""
    return Columns(fields).find(column)
