from __future__ import annotations

import pytest
from posecast_edge.profile.types import Columns, FieldSpec, find_column

FIELDS = (
    FieldSpec("pos", "joint", ("A", "B")),
    FieldSpec("ref", "joint", ("A", "C")),
    FieldSpec("baseq", "baseq", ("base.w", "base.x")),
    FieldSpec("ftf", "ftf", ("LF.fz", "RF.fz")),
    FieldSpec("volt", "volt", ("main",)),
)


@pytest.mark.parametrize(
    ("column", "where"),
    [
        ("A", ("ref", 0)),
        ("C", ("ref", 1)),
        ("B", None),  # ref goes before pos
        ("pos.B", ("pos", 1)),
        ("baseq.w", ("baseq", 0)),
        ("baseq.base.x", ("baseq", 1)),
        ("ftf.fz", None),  # of which foot?
        ("ftf.RF.fz", ("ftf", 1)),
        ("volt.main", ("volt", 0)),
        ("volt", ("volt", 0)),
        ("amp.main", None),
        ("", None),
    ],
)
def test_where_a_column_goes(column: str, where: tuple[str, int] | None) -> None:
    assert Columns(FIELDS).find(column) == where
    assert find_column(FIELDS, column) == where
