"""Schemas, codes and streams for property tests."""

from __future__ import annotations

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from posecast_testing import count_examples
from posecast_wire import CODE_MAX, MISSING, Schema, build_schema_text

SLOW = settings(max_examples=count_examples(80), deadline=None, suppress_health_check=[HealthCheck.too_slow])
LABELS = {"s0": ["x"], "s1": ["x", "y", "z"], "s2": [f"j{i}" for i in range(17)]}
CODES = st.one_of(
    st.integers(-40, 40),
    st.integers(-40, 40),
    st.sampled_from([MISSING, -CODE_MAX, CODE_MAX]),
    st.integers(MISSING, CODE_MAX),
)


@st.composite
def schemas(draw: st.DrawFn) -> Schema:
    """One to five fields over three label sets, some of them relative to an earlier one of their size."""
    fields: list[dict[str, object]] = []
    for i in range(draw(st.integers(1, 5))):
        labels = draw(st.sampled_from(sorted(LABELS)))
        one: dict[str, object] = {"name": f"f{i}", "labels": labels}
        partners = [f["name"] for f in fields if f["labels"] == labels]
        one["rel"] = draw(st.sampled_from([None, *partners]))
        if draw(st.booleans()):
            one["bits"] = ["a", "b"]
        else:
            one["scale"] = draw(st.sampled_from([0.001, 0.05, 1, 2.5]))
        fields.append(one)
    return Schema.parse(build_schema_text("r", LABELS, fields))


@st.composite
def streams(draw: st.DrawFn) -> tuple[Schema, list[list[int]]]:
    """A schema, and the codes of up to 14 frames."""
    schema = draw(schemas())
    state = st.lists(CODES, min_size=schema.size, max_size=schema.size)
    return schema, draw(st.lists(state, min_size=1, max_size=14))
