"""docs/SCALING.md and its plots are what tools/scaling.py makes of its constants; the arithmetic."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tools import plot, scaling

ROOT = Path(__file__).resolve().parents[1]


def test_page_and_plots_are_up_to_date(tmp_path: Path) -> None:
    script = [sys.executable, "-m", "tools.scaling", "--out", str(tmp_path)]
    subprocess.run(script, cwd=ROOT, check=True, timeout=60)
    made = sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file())
    assert [str(path) for path in made] == [
        "OPERATIONS.md",
        "SCALING.md",
        "img/scaling-cost.svg",
        "img/scaling-processes.svg",
    ]
    for path in made:
        assert (tmp_path / path).read_text() == (ROOT / "docs" / path).read_text(), (
            f"docs/{path} is not what tools/scaling.py writes: run `python -m tools.scaling`"
        )


def test_the_page_names_the_constants_it_uses() -> None:
    page = (ROOT / "docs" / "SCALING.md").read_text()
    around = scaling.WEBSOCKET_BYTES + scaling.TLS_BYTES + scaling.TCP_IP_BYTES
    for said in (
        f"{scaling.CPU_US_PER_MESSAGE:g} µs",
        f"{scaling.RSS_MB_PER_1000:g} kB",
        f"{around:g} B",
        f"{scaling.HANDSHAKES_PER_S:,.0f} hands a second",
        f"{scaling.CORE_SHARE:g} core",
    ):
        assert said in page, said


def test_benchmarks_page_has_what_scaling_stands_on() -> None:
    page = (ROOT / "docs" / "BENCHMARKS.md").read_text()
    for said in (f"{scaling.CPU_US_PER_MESSAGE:g}", f"{scaling.RSS_MB_PER_1000:g}"):
        assert said in page, f"BENCHMARKS.md does not say {said}"


def test_a_process_holds_what_its_tightest_limit_allows() -> None:
    assert scaling.viewers_per_process(10) == scaling.VIEWERS_PER_PROCESS_MAX
    by_cpu = scaling.CORE_SHARE * 1e6 / (scaling.CPU_US_PER_MESSAGE * 30)
    assert scaling.viewers_per_process(30) == int(by_cpu)


def test_where_there_are_several_one_may_be_missing() -> None:
    assert scaling.processes(1000, 10) == 1
    each = scaling.viewers_per_process(10)
    assert scaling.processes(each, 10) == 1
    assert scaling.processes(each + 1, 10) == 3


def test_ten_times_the_viewers_ten_times_the_traffic() -> None:
    assert scaling.egress_gbit_s(10_000, 10) == pytest.approx(10 * scaling.egress_gbit_s(1000, 10))


def test_numbers_have_two_or_three_digits() -> None:
    assert [scaling.number(v) for v in (0.01234, 1.26, 99.4, 1234.0)] == ["0.012", "1.3", "99", "1,230"]


def test_a_logarithmic_plot_refuses_zero() -> None:
    with pytest.raises(ValueError, match="above 0"):
        plot.lines("x", "a", "b", [plot.Line("l", [(0.0, 1.0)])])
