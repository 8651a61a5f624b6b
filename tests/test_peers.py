"""The bench of peers: the relay's own row always, whoever else is installed here besides."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from benches.peers import mqtt
from benches.peers.peers import PEERS, mosquitto_settings, mqtt_viewers, nats_viewers
from benches.peers.run import SCENARIOS

ROOT = Path(__file__).resolve().parents[1]


def test_mqtt_packets() -> None:
    """Held against the examples of MQTT 3.1.1, 2.2.3 and 3.1."""
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
    """The relay; in the long tests everybody who is installed here. Who is not is named."""
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
