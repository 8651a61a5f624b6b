"""What relays tell each other: there and back, and nothing else gets in."""

from __future__ import annotations

import json
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_relay.adapters.relayed import Standing, Update, unpack

UPDATE = Update("public", 2, 0xE, "p:1", "p:1", 0.25, ((5, b"abc"), (6, b"")), ('{"n":1}',))
updates = st.builds(
    Update,
    view=st.text(),
    generation=st.integers(0, 1 << 53),
    run_id=st.integers(1, (1 << 64) - 1),
    version=st.text(),
    numbering=st.text(),
    late_s=st.integers(0, 10**6).map(lambda n: n / 10_000),
    frames=st.lists(st.tuples(st.integers(0, 1 << 62), st.binary())).map(tuple),
    events=st.lists(st.text()).map(tuple),
)
ages = st.none() | st.integers(0, 10**6).map(lambda ms: ms / 1000)
standings = st.builds(Standing, token=st.booleans(), ages_s=st.dictionaries(st.text(), ages))


@given(updates | standings)
def test_what_is_packed_is_unpacked(said: Update | Standing) -> None:
    assert unpack(said.pack()) == said


@given(st.binary())
def test_bytes_are_refused_by_one_error(data: bytes) -> None:
    for start in (b"", b"U", b"S"):
        with suppress(ValueError):
            unpack(start + data)


@pytest.mark.parametrize("cut", [-1, 1])
def test_frames_of_another_length_are_refused(cut: int) -> None:
    data = UPDATE.pack()
    with pytest.raises(ValueError, match="another length"):
        unpack(data[:-1] if cut < 0 else data + b"x")


@pytest.mark.parametrize(
    "change",
    [{"run": "0"}, {"run": "x"}, {"run": "1" * 17}, {"frames": 1}, {"frames": [[1]]}, {"events": None},
     {"generation": "x"}, {"late": None}, {"numbering": ...}],
)  # fmt: skip
def test_a_broken_update_is_refused(change: dict[str, object]) -> None:
    head, _, rest = UPDATE.pack()[1:].partition(b"\n")
    doc = json.loads(head) | change
    doc = {name: value for name, value in doc.items() if value is not ...}
    with pytest.raises(ValueError, match=r"."):
        unpack(b"U" + json.dumps(doc).encode() + b"\n" + rest)
