"""What a column of a trajectory file means: which field, which channel of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from posecast_wire.mapping import JOINT

if TYPE_CHECKING:
    from posecast_edge.profile import FieldSpec


def find_column(fields: Sequence[FieldSpec], column: str) -> tuple[str, int] | None:
    """(field, channel) of a column: a joint's name is in ref, `FIELD.LABEL` in that field.

    A field with one site needs the component alone: `baseq.w` is `base.w` in `baseq`.
    None when there is no such channel. Without a field `ref` the joints go to `pos`.
    """
    joints = [f for name in ("ref", "pos") for f in fields if f.name == name and f.label_set == JOINT]
    if joints and column in joints[0].labels:
        return joints[0].name, joints[0].labels.index(column)
    name, _, rest = column.partition(".")
    for field in fields:
        if field.name == name:
            hits = [i for i, label in enumerate(field.labels) if rest in (label, label.partition(".")[2])]
            return (name, hits[0]) if len(hits) == 1 else None
    return None
