"""JSON that everybody can read, whatever was put in."""

from __future__ import annotations

import json
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from posecast_relay.kit import json_bytes

ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters()),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(st.characters()), inner, max_size=4),
)


def refuse(name: str) -> Any:
    """NaN, Infinity."""
    raise AssertionError(name)


@given(ANYTHING)
def test_it_is_utf8_and_finite(document: object) -> None:
    json.loads(json_bytes(document).decode(), parse_constant=refuse)


def test_what_cannot_be_said() -> None:
    assert (
        json_bytes({"a": [1.5, math.nan, -math.inf, "x\ud800", "ü"]})
        == '{"a":[1.5,null,null,"x?","ü"]}'.encode()
    )
