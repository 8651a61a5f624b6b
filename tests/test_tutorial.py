"""docs/tutorials/first-robot.md, followed word for word from its first command to its last, on a separate
machine."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import Process, until

from tests import test_install
from tests.conftest import BIN
from tests.doc_blocks.block import read_blocks
from tests.test_install import PLAIN, UV

PAGE = (Path(__file__).resolve().parent.parent / "docs/tutorials/first-robot.md").read_text(encoding="utf-8")
PROGRAM = re.findall(r"Save this as `(\w+\.py)`", PAGE)[0]
ACTIVATE = ". venv/bin/activate\n"
wheels, alone = test_install.wheels, test_install.alone


def blocks(language: str) -> list[str]:
    return read_blocks("docs/tutorials/first-robot.md", language)


class Reader:
    """Types the page's commands into the terminals of an empty machine."""

    def __init__(self, stack: Any, place: Any, folder: Path) -> None:
        self.stack, self.place, self.folder = stack, place, folder

    def sh(self, script: str) -> str:
        """To its end; what it printed."""
        command = ["bash", "-euc", ACTIVATE + script]
        done = self.place.run(
            lambda: subprocess.run(
                command, cwd=self.folder, env=PLAIN, capture_output=True, text=True, check=False, timeout=60
            )
        )
        assert done.returncode == 0, f"{script}\n{done.stdout}{done.stderr}"
        return str(done.stdout)

    def start(self, name: str, line: str) -> Process:
        """In a separate terminal."""
        script = f"cd '{self.folder}'\n{ACTIVATE}exec {line}"
        words = ("env", "-i", *(f"{k}={v}" for k, v in PLAIN.items()), "bash", "-euc", script)
        part: Process = self.place.run(lambda: self.stack.start(name, *words))
        return part

    def ask(self, url: str, token: str = "") -> Any:
        """The JSON answer, or the status of a refusal."""
        request = urllib.request.Request(url, headers={"Authorization": f"Bearer {token}"} if token else {})

        def fetch() -> Any:
            try:
                with urllib.request.urlopen(request, timeout=5) as answer:
                    return json.load(answer)
            except urllib.error.HTTPError as e:
                return e.code

        return self.place.run(fetch)


def until_state(reader: Reader, url: str, what: str, holds: Callable[[Any], bool], token: str = "") -> Any:
    """The robot's first state that is as wanted."""

    def look() -> Any:
        state = reader.ask(url, token)
        return state if isinstance(state, dict) and holds(state) else None

    return until(what, look)


def is_jammed(state: Any) -> bool:
    """With the error that the page describes."""
    if "flags" not in state["fields"]:
        return False
    elbow = {name: field["values"]["elbow"] for name, field in state["fields"].items()}
    return bool(elbow["flags"] == ["jam"] and elbow["pos"] == 0.2 and elbow["ref"] - elbow["pos"] > 1)


def install(wheels: Path, folder: Path) -> None:
    build, steps = blocks("sh")[:2]
    assert build == "make dist\n"  # which the fixture has done
    assert "\npip install " in steps
    (folder / "dist").symlink_to(wheels)
    # uv takes what setup has fetched already; pip itself would download it
    taken = steps.replace("\npip install ", f"\n{UV} pip install --quiet ")
    environment = {**PLAIN, "PATH": f"{BIN}:{PLAIN['PATH']}"}
    subprocess.run(["bash", "-euc", taken], cwd=folder, env=environment, check=True, timeout=300)


@pytest.mark.skipif(sys.platform != "linux", reason="network namespaces are Linux's")
def test_a_reader_arrives_where_the_page_says(stack: Any, wheels: Path, alone: Any, tmp_path: Path) -> None:
    check, relay_dev, wave, again, share, link = blocks("sh")[2:]
    program, jam_line, with_line = blocks("python")
    (urdf,) = blocks("xml")
    install(wheels, tmp_path)
    reader = Reader(stack, alone, tmp_path / "first-robot")
    (reader.folder / "arm.urdf").write_text(urdf, encoding="utf-8")
    said = reader.sh(check).strip()
    assert f"`{said}`" in PAGE

    relay = reader.start("relay", relay_dev)
    relay.line(r"serving http://127\.0\.0\.1:8080, robots on tcp/127\.0\.0\.1:7447")
    (reader.folder / PROGRAM).write_text(program, encoding="utf-8")
    robot = reader.start("wave", wave)
    (page, name) = re.findall(r"<(http://\S+)/#/r/(\S+)>", PAGE)[0]
    state_url = f"{page}/api/v1/robots/{name}/state"
    poses: set[str] = set()

    def waves(state: Any) -> bool:
        poses.add(json.dumps(state["fields"]["pos"]["values"]))
        return state["status"] == "online" and len(poses) >= 5

    state = until_state(reader, state_url, "the arm waves", waves)
    assert state["fields"]["ref"]["values"] == state["fields"]["pos"]["values"]
    (listed,) = reader.ask(f"{page}/api/v1/robots")["robots"]
    manifest = reader.ask(f"{page}/api/v1/robots/{name}/model/{listed['model']}/manifest.json")
    assert [file["path"] for file in manifest["files"]] == ["arm.urdf"]

    robot.stop()
    until_state(reader, state_url, "it is offline", lambda state: state["status"] == "offline")
    jammed = re.sub(r"^ +robot\.publish\(.*\n", lambda _: jam_line, program, flags=re.MULTILINE)
    assert jammed != program
    (reader.folder / PROGRAM).write_text(jammed, encoding="utf-8")
    assert again == wave
    robot = reader.start("jam", again)
    until_state(reader, state_url, "the elbow is jammed", is_jammed)

    robot.stop()
    relay.stop()
    *before, serve = share.splitlines(keepends=True)
    reader.sh("".join(before))
    reader.start("relay", serve).line(r"serving http://0\.0\.0\.0:8080, robots on tcp/127\.0\.0\.1:7447")
    shared = re.sub(r"^with .*\n", lambda _: with_line, jammed, flags=re.MULTILINE)
    assert shared != jammed
    (reader.folder / PROGRAM).write_text(shared, encoding="utf-8")
    reader.start("shared", again)
    token = reader.sh(link).strip().partition("?t=")[2]
    until_state(reader, state_url, "it is seen by its link", is_jammed, token)
    assert reader.ask(state_url) == 404
    assert reader.ask(f"{page}/api/v1/robots")["robots"] == []
