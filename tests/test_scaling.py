"""The page on scaling and its plots are what tools/scaling.py makes of tools/crowd.py; the arithmetic."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tools import crowd, plot, scaling, segment_bytes

ROOT = Path(__file__).resolve().parents[1]
SHARED = Path(os.environ.get("POSECAST_SHARED", ROOT.parent / "shared"))


def test_page_and_plots_are_up_to_date(tmp_path: Path) -> None:
    script = [sys.executable, "-m", "tools.scaling", "--out", str(tmp_path)]
    subprocess.run(script, cwd=ROOT, check=True, timeout=60)
    made = sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file())
    assert [str(path) for path in made] == [
        "img/scaling-cost.svg",
        "img/scaling-origin.svg",
        "reference/capacity.md",
    ]
    for path in made:
        assert (tmp_path / path).read_text() == (ROOT / "docs" / path).read_text(), (
            f"docs/{path} is not what tools/scaling.py writes: run `python -m tools.scaling`"
        )


def test_a_page_without_its_markers_is_refused() -> None:
    with pytest.raises(ValueError, match="'capacity'"):
        scaling.written("reference/capacity.md", "# Capacity\n")


def test_the_pages_name_the_constants_they_use() -> None:
    pages = (ROOT / "docs" / name for name in ("reference/capacity.md", "explanation/scaling.md"))
    text = " ".join(" ".join(page.read_text() for page in pages).split())
    around = crowd.WEBSOCKET_BYTES + crowd.TLS_BYTES + crowd.TCP_IP_BYTES
    for said in (
        f"{crowd.CPU_US_PER_MESSAGE:g} µs",
        f"{crowd.RSS_MB_PER_1000:g} kB",
        f"{around:g} B",
        f"{crowd.HANDSHAKES_PER_S:,.0f} handshakes a second",
        f"{crowd.CORE_SHARE:g} core",
        f"segment + {crowd.ANSWER_BYTES:g} B, and {crowd.TCP_IP_BYTES:g} B for each",
        f"{crowd.TCP_PAYLOAD_BYTES:,.0f} of these bytes",
        f"{crowd.ORIGIN_MS_PER_ANSWER:g} ms",
        f"length + {crowd.BEHIND_S:g} s",
        f"{crowd.NODES} caches stand for a CDN",
        f"watched through {crowd.NODES} caches",
        f"{crowd.NEWCOMER_BYTES / 1e6:g} MB and {crowd.NEWCOMER_REQUESTS:g} requests",
        f"| {crowd.BOTH.per_gb:g} a GB, {crowd.BOTH.per_million:.2f} a million requests |",
        f"| {crowd.REQUESTS.per_million:.2f} a million |",
        f"| {crowd.BYTES.per_gb:g} a GB |",
        f"{crowd.CORE_HOUR:g} an hour for each server, which sends {crowd.CACHE_GBIT_S:g} Gbit/s",
        f"; {crowd.FLAT_GB:g} a GB |",
        f"{crowd.compute_lane_requests_per_h(1e6, 4) / 1e6:.0f} million requests an hour",
        f"one core serves about {crowd.count_viewers_per_process(30) // 100 * 100:,} viewers at 30 Hz",
        f"| up to {crowd.count_viewers_per_process(30) // 100 * 100:,} | one relay |",
        f"handshakes is enough to refuse {crowd.count_retrying_viewers() // 1000 * 1000:,}. ",
        f"{crowd.count_retrying_viewers() // 1000 * 1000:,} in the lane per process",
        f"asked is {crowd.compute_deploy_share(5000, 10):.0%} of its handshakes".replace("%", " %"),
        f"an instance of {crowd.INSTANCE_MB:g} MB, less {crowd.PROCESS_MB:g} for a relay",
        f"for each {crowd.CORE_SHARE * 1e6 / crowd.NGINX_US_PER_ANSWER:,.0f} answers a second",
    ):
        assert said in text, said


def test_benchmarks_page_has_what_scaling_stands_on() -> None:
    page = (ROOT / "docs" / "reference/benchmarks.md").read_text()
    for said in (
        f"{crowd.CPU_US_PER_MESSAGE:g}",
        f"{crowd.RSS_MB_PER_1000:g}",
        f"{crowd.HANDSHAKES_PER_S:,.0f}",
    ):
        assert said in page, f"reference/benchmarks.md does not say {said}"


# ---- by WebSocket ----


def test_a_process_holds_what_its_tightest_limit_allows() -> None:
    assert crowd.count_viewers_per_process(10) == crowd.VIEWERS_PER_PROCESS_MAX
    by_cpu = crowd.CORE_SHARE * 1e6 / (crowd.CPU_US_PER_MESSAGE * 30)
    assert crowd.count_viewers_per_process(30) == int(by_cpu)


def test_where_there_are_several_one_may_be_missing() -> None:
    assert crowd.count_processes(1000, 10) == 1
    each = crowd.count_viewers_per_process(10)
    assert crowd.count_processes(each, 10) == 1
    assert crowd.count_processes(each + 1, 10) == 3


def test_a_viewer_gets_frames_and_what_is_around_them() -> None:
    assert crowd.compute_socket_bytes_per_s(30, 100.0) == 30 * (100 + 2 + 22 + 52) + 100
    assert crowd.compute_socket_gb_per_h(1000, 10) == pytest.approx(1000 * (10 * 166.2 + 100) * 3600 / 1e9)


def test_cores_and_egress_are_paid() -> None:
    gb = crowd.compute_socket_gb_per_h(10_000, 10)
    assert crowd.compute_socket_cost_per_h(10_000, 10, 0.085) == pytest.approx(3 * 0.04 + 0.085 * gb)


# ---- by the lane ----


@pytest.mark.parametrize(
    ("segment", "on_the_line"),
    [
        (1004.0, 1004 + 444 + 52),  # just fills a packet
        (1005.0, 1005 + 444 + 2 * 52),
        (16_383.0, 16_383 + 444 + 12 * 52),
        (16_384.0, 16_384 + 444 + 22 + 12 * 52),  # a second record of TLS
    ],
)
def test_an_answer_is_sent_in_packets_and_records(segment: float, on_the_line: float) -> None:
    assert crowd.compute_answer_bytes(segment) == on_the_line


def test_a_viewer_asks_once_for_each_segment() -> None:
    assert crowd.compute_lane_requests_per_h(1, 4) == 900
    assert crowd.compute_lane_requests_per_h(1_000_000, 2) == 1.8e9
    answer = crowd.compute_answer_bytes(crowd.SEGMENT_BYTES["mixed", 30, 4])
    assert crowd.compute_lane_gb_per_h(1000, 30, 4) == pytest.approx(1000 * 900 * answer / 1e9)


def test_the_relay_is_asked_by_caches_alone() -> None:
    assert crowd.compute_origin_requests_per_s(80, 4) == 20  # fewer viewers than caches
    assert crowd.compute_origin_requests_per_s(1000, 4) == 50
    assert crowd.compute_origin_requests_per_s(1_000_000, 4) == 50
    assert crowd.compute_origin_cores(1_000_000, 4) == pytest.approx(50 * crowd.ORIGIN_MS_PER_ANSWER / 1000)
    assert crowd.count_origin_processes(1_000_000, 4) == 1


def test_who_charges_what() -> None:
    viewers = 1_000_000
    gb, origin_gb = crowd.compute_lane_gb_per_h(viewers, 30, 4), crowd.compute_lane_gb_per_h(200, 30, 4)
    relay = 0.04 + origin_gb * crowd.CLOUD_GB

    def cost(provider: crowd.Provider) -> float:
        return crowd.compute_lane_cost_per_h(viewers, 30, 4, provider)

    assert cost(crowd.REQUESTS) == pytest.approx(relay + 900 * 0.30)
    assert cost(crowd.BYTES) == pytest.approx(relay + gb * 0.01)
    assert cost(crowd.BOTH) == pytest.approx(relay + gb * 0.085 + 900 * 1.00)


def test_own_caches_are_as_many_as_their_lines_need() -> None:
    """A million at 30 Hz and 4 s: 24.5 Gbit/s, so 41 servers of 0.6 Gbit/s, and one more."""
    assert crowd.count_own_caches(1_000_000, 30, 4) == 42
    assert crowd.count_own_caches(1000, 30, 4) == 1
    gb = crowd.compute_lane_gb_per_h(1_000_000 + 42, 30, 4)  # the relay serves 42 caches
    cost = crowd.compute_lane_cost_per_h(1_000_000, 30, 4, crowd.NEITHER)
    assert cost == pytest.approx(43 * 0.04 + gb * crowd.FLAT_GB)


def test_a_segment_is_its_frames_and_little_beside() -> None:
    for (motion, hz), frame in crowd.FRAME_BYTES.items():
        beside = crowd.SEGMENT_BYTES[motion, hz, 4] / (hz * 4) - frame
        assert 8 < beside < 11, (motion, hz, beside)  # what the page says


def test_segments_and_frames_are_as_large_as_it_says() -> None:
    path = SHARED / "telemetry" / "schema.json"
    if not path.exists():
        pytest.skip("the telemetry sets are missing (set POSECAST_SHARED to their folder)")
    for hz in (10, 30):
        played = segment_bytes.play(path.read_text(), path.with_name("idle.npz"), hz, 4.0, 6.0)
        assert played.frame_bytes == pytest.approx(crowd.FRAME_BYTES["idle", hz], abs=0.1)
        assert played.segment_s == 4.0
        size = played.bytes / played.segments
        assert size == pytest.approx(crowd.SEGMENT_BYTES["idle", hz, 4], rel=0.002)


# ---- what is written ----


def test_the_cheapest_length_is_bold() -> None:
    row = next(line for line in scaling.million().splitlines() if line.startswith("| requests |"))
    assert row.split(" | ")[1:4] == ["540", "270", "**108**"]


def test_numbers_have_two_or_three_digits() -> None:
    assert [scaling.number(v) for v in (0.01234, 1.26, 99.4, 1234.0)] == ["0.012", "1.3", "99", "1,230"]


def test_a_logarithmic_plot_refuses_zero() -> None:
    with pytest.raises(ValueError, match="above 0"):
        plot.lines("x", "a", "b", [plot.Line("l", [(0.0, 1.0)])])
