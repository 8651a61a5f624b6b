from __future__ import annotations

import math
from typing import Any

import pytest

from fuzz.differ import agree, difference
from fuzz.target import Differs, Refused


@pytest.mark.parametrize(
    ("ours", "page"),
    [
        (1, 1.0),
        (-0.0, 0),
        (math.nan, math.nan),
        ((1, 2), [1, 2]),
        ({"a": None}, {"a": None}),
        (True, True),
        (1.8446744073711866e19, 18446744073711866000),
    ],
)
def test_the_same(ours: Any, page: Any) -> None:
    assert difference(ours, page) is None


@pytest.mark.parametrize(
    ("ours", "page", "where"),
    [
        (1, 2, "value: 1 here, 2 there"),
        (True, 1, "value: True here, 1 there"),
        ([1, [2, 3]], [1, [2, 4]], "value[1][1]: 3 here, 4 there"),
        ({"a": 1}, {"a": 1, "b": 2}, "value: members differ by ['b']"),
        ([1], [1, 2], "value: 1 here, 2 there"),
        ("1", 1, "value: '1' here, 1 there"),
        ({"a": {"b": "\ud800"}}, {"a": {"b": "x"}}, "value.a.b: '\\ud800' here, 'x' there"),
    ],
)
def test_not_the_same(ours: Any, page: Any, where: str) -> None:
    assert difference(ours, page) == where


def test_whole_numbers_are_compared_exactly() -> None:
    assert difference((1 << 53) - 1, (1 << 53) - 2) is not None


def refuse() -> None:
    raise KeyError("no")


def page_refuses() -> None:
    raise Refused("no")


def test_both_refuse() -> None:
    with pytest.raises(KeyError):
        agree(refuse, page_refuses, (KeyError,), list)


def test_only_one_refuses() -> None:
    with pytest.raises(Differs, match=r"Python says .*, TypeScript takes it"):
        agree(refuse, list, (KeyError,), list)
    with pytest.raises(Differs, match="Python takes it, TypeScript says 'no'"):
        agree(list, page_refuses, (KeyError,), list)
