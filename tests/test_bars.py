"""The plots of docs/reference/benchmarks.md agree with its tables."""

from __future__ import annotations

import pytest

from tools.bars import PAGE, bars_of

pytestmark = pytest.mark.docs

TABLE = """
<!-- bars: ../img/x.svg | Cost | µs | µs CPU -->

| server | µs | note |
|---|---|---|
| **relay** | **8.3** (8.1–9.5) | |
| `ws` | 13.6 | |
| none | – | not measured |
"""


def test_one_bar_per_row_that_has_a_figure() -> None:
    (image,) = bars_of(TABLE).values()
    assert image.count("<rect") == 1 + 2  # the paper and two bars
    for text in ("Cost", "relay", "8.3 µs CPU", "ws", "13.6 µs CPU"):
        assert text in image
    assert "none" not in image


def test_a_marker_without_its_table_is_named() -> None:
    with pytest.raises(ValueError, match=r"benchmarks.md:2: no table with a column 'ms'"):
        bars_of(TABLE.replace("| µs | µs CPU", "| ms | ms"))


def test_plots_are_up_to_date() -> None:
    made = bars_of(PAGE.read_text())
    assert made
    for name, image in made.items():
        assert (PAGE.parent / name).read_text() == image, f"{name}: run `python -m tools.bars`"
        assert f"({name})" in PAGE.read_text(), f"{name} is shown nowhere"
