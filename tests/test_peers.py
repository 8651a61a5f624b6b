"""The peer benchmark: always the relay's own row, and those of all other peers installed here."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from benches.peers import mqtt, page
from benches.peers.peers import PEERS, mosquitto_settings, mqtt_viewers, nats_viewers
from benches.peers.run import SCENARIOS
from tools.bars import PAGE, bars_of
from tools.pages import fill

ROOT = Path(__file__).resolve().parents[1]


def test_mqtt_packets() -> None:
    """Checked against the examples in MQTT 3.1.1, 2.2.3 and 3.1."""
    assert mqtt.connect().hex() == "100c00044d515454040200000000"
    assert mqtt.subscribe().hex() == "820600010001" + b"f".hex() + "00"
    assert mqtt.packet(0x30, bytes(321))[:3].hex() == "30c102"
    assert len(mqtt.packet(0x30, bytes(16384))) == 1 + 3 + 16384


def test_viewers_skip_what_stands_before_the_frame() -> None:
    steady, slow = SCENARIOS["steady"], SCENARIOS["slow"]
    assert mqtt_viewers(steady)["--skip"] == len(mqtt.publish(bytes(200))) - 200 == 6
    assert mqtt_viewers(slow)["--skip"] == 6
    assert nats_viewers(steady)["--skip"] == len("MSG f 1 200\r\n")


def test_mosquitto_listens_for_robots_and_browsers() -> None:
    lines = mosquitto_settings(1883, 9001).splitlines()
    assert lines.index("protocol websockets") == lines.index("listener 9001 127.0.0.1") + 1


@pytest.mark.parametrize(
    "asked", [["posecast"], pytest.param([], marks=pytest.mark.full)], ids=["relay", "all"]
)
def test_a_small_run(tmp_path: Path, asked: list[str]) -> None:
    """The relay; in the long tests, every installed peer. Missing ones are reported."""
    if shutil.which("cc") is None:
        pytest.skip("no C compiler (cc) here")
    small = ["--quick", "--only", "steady", "--out", str(tmp_path)]
    command = [sys.executable, "-m", "benches.peers.run", *asked, *small]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=150, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "peers.json").read_text())
    ran = {row["server"]: row for row in report["runs"]}
    assert ran.keys() | report["absent"].keys() == set(asked or [peer.name for peer in PEERS])
    for name, row in ran.items():
        assert (row["opened"], row["failed"], row["closed"]) == (40, 0, 0), name
        assert (row["duplicates"], row["reordered"], row["unreadable"]) == (0, 0, 0), name
        assert row["messages"] > 40, name
    for name in report["absent"]:
        assert f"not measured: {name} (" in done.stdout


def row(scenario: str, server: str, cpu_us: float, round_number: int = 0) -> dict[str, object]:
    """One run, as peers.json has it."""
    return {
        "scenario": scenario,
        "server": server,
        "round": round_number,
        "cpu_us": cpu_us,
        "messages_per_cpu_s": 1e6 / cpu_us,
        "lateness_ms": {"p50": 5.0, "p99": 12.5},
        "mb_per_viewer_hour": 22.0,
        "rss_mb_per_1000": 9.5,
        "others_share": 0.04,
        "missed_share": 0.001,
        "wall_s": 30.0,
        "frozen": {"rss_kib_each": 2000.0, "fds_gone_s": None if server == "ws" else 11.0},
    }


def test_the_page_is_written_from_a_run() -> None:
    """Both tables and plots, sorted by cost, the relay first."""
    about = {"day": "1 May 2026", "commit": "abc1234", "kernel": "6", "cores": 2, "cpu": "some"}
    runs = [
        row(scenario, server, cost * (1 + number), number)
        for number in (0, 1)
        for scenario in ("steady", "slow")
        for server, cost in (("nats", 16.0), ("posecast", 8.0), ("ws", 12.0))
    ]
    report = {
        "machine": about | {"load_average_before": 0.2, "load_average_after": 1.0},
        "runs": runs,
        "absent": {"mosquitto": "no mosquitto"},
    }
    said = page.block(report)
    steady = [line for line in said.splitlines() if line.startswith("| ")][1:4]
    assert [line.split("|")[1].strip(" *") for line in steady] == [
        "posecast-relay",
        "ws 8.23.0 (Node)",
        "nats-server (Go)",
    ]
    assert "| 1.50 (1.50–1.50) | 18.0 (12.0–24.0) |" in steady[1]
    assert "commit `abc1234`" in said
    assert "took at most 4% of the server's core.\n" in said
    assert "| not in 30 s |" in said
    assert said.endswith("Not measured: mosquitto (no mosquitto).")
    written = fill(PAGE.read_text(), {"peers": said}, "benchmarks.md")
    assert written.count(said) == 1
    assert {"../img/bench-peers.svg", "../img/bench-peers-slow.svg"} <= bars_of(written).keys()
