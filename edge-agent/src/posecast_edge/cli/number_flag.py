"""The type of flags that take a number."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from posecast_edge.kit import quote


def limit_number(low: float, high: float) -> Callable[[str], float]:
    """A type for argparse: a number from `low` to `high`."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{quote(text)} is not a number from {low:g} to {high:g}")
        return value

    return parse
