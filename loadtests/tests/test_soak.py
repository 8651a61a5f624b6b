"""A soak of seconds on the real parts: that everything is read, judged and told."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ALWAYS_READ = {"relay RSS", "relay descriptors", "relay threads", "relay tasks", "edge RSS", "Redis"}

PAGE = Path(__file__).resolve().parents[2] / "spa" / "dist" / "index.html"


def soaked(out: Path, *arguments: str) -> tuple[dict[str, Any], str]:
    command = [sys.executable, "-m", "posecast_loadtests.soak", "--out", str(out), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=150, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    report: dict[str, Any] = json.loads((out / "soak.json").read_text())
    return report, done.stdout


def test_a_soak_of_seconds(tmp_path: Path) -> None:
    report, said = soaked(tmp_path, "--minutes", "0.1", "--viewers", "20", "--no-page")
    assert report["series"].keys() >= ALWAYS_READ
    assert len(report["series"]["relay RSS"]) >= 3
    assert max(value for _, value in report["series"]["relay descriptors"]) >= 20
    verdicts = {finding["name"]: finding["verdict"] for finding in report["findings"]}
    for name in ("relay descriptors", "relay threads", "relay tasks", "edge descriptors", "edge threads"):
        assert verdicts[name] == "kept", said
    assert verdicts["page heap"] == "not shown"
    assert report["breaches"] == []
    assert report["counts"]["frames"] > 20
    assert report["told"].keys() >= {"posecast_store_losses_total"}
    assert "0.1 minutes (the limits are for 30)" in said


@pytest.mark.full
def test_a_page_is_watched_too(tmp_path: Path) -> None:
    if shutil.which("chromium") is None or not PAGE.is_file():
        pytest.skip("no chromium or no built page here")
    report, said = soaked(tmp_path, "--minutes", "0.5", "--viewers", "5", "--static", str(PAGE.parent))
    heap_mb = [value for _, value in report["series"]["page heap, 3D"]]
    assert len(heap_mb) >= 2, said
    assert min(heap_mb) > 1, said
