from __future__ import annotations

import pytest
from posecast_edge.profile.reader import TermError, resolve_entries
from posecast_wire.schema import JointMap


def joint(*terms: tuple[str, float], offset: float = 0.0) -> JointMap:
    return JointMap(terms, offset)


def test_a_joint_that_follows_a_joint_ends_at_channels() -> None:
    entries = {
        "k3": joint(("k2", 0.5), offset=0.25),
        "k1": joint(("M", 2.0), offset=1.0),
        "k2": joint(("k1", 3.0), ("N", 1.0)),
    }
    assert resolve_entries(entries, ["M", "N"]) == {
        "k3": joint(("M", 3.0), ("N", 0.5), offset=1.75),
        "k1": joint(("M", 2.0), offset=1.0),
        "k2": joint(("M", 6.0), ("N", 1.0), offset=3.0),
    }


def test_a_name_that_is_both_means_the_channel() -> None:
    entries = {"A": joint(("A", 1.0), offset=0.5), "B": joint(("A", 1.0), ("C", 1.0))}
    assert resolve_entries(entries, ["A", "C"]) == entries


def test_differential_drives_share_channels() -> None:
    entries = {"pitch": joint(("L", 1.0), ("R", 1.0)), "roll": joint(("L", -1.0), ("R", 1.0))}
    assert resolve_entries(entries, ["L", "R"]) == entries


@pytest.mark.parametrize(
    ("entries", "where", "reason"),
    [
        ({"a": joint(("x", 1.0))}, ("a", 0), "unknown joint 'x'"),
        ({"a": joint(("a", 1.0))}, ("a", None), "a loop: a → a"),
        (
            {"a": joint(("b", 1.0)), "b": joint(("c", 1.0), ("M", 1.0)), "c": joint(("b", 1.0))},
            ("b", None),
            "a loop: b → c → b",
        ),
        (
            {"a": joint(("M", 1.0)), "b": joint(("M", -1.0))},
            ("b", 0),
            "channel 'M' already moves joint 'a'; for a joint that moves with it, use 'a' as the term",
        ),
    ],
)
def test_what_cannot_be(entries: dict[str, JointMap], where: tuple[str, int | None], reason: str) -> None:
    with pytest.raises(TermError) as caught:
        resolve_entries(entries, ["M"])
    assert (caught.value.joint, caught.value.term) == where
    assert caught.value.reason == reason
