"""Adding a source, a description format and a store, as docs/ARCHITECTURE.md says: a file and a row each."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from pathlib import Path

import httpx
from posecast_testing import until_async
from posecast_wire.frame import parse_header

from .conftest import Stack, Viewer

PROGRAM = (sys.executable, "-m", "tests.adding.programs")
BONES = 4


async def test_a_new_source_format_and_store_work_together(tmp_path: Path) -> None:
    stack = Stack(tmp_path, relay_command=(*PROGRAM, "relay"), edge_command=(*PROGRAM, "edge"))
    description = tmp_path / "arm.xml"
    description.write_text(f'<stick bones="{BONES}"/>')
    built = tmp_path / "built"
    subprocess.run([*PROGRAM, "edge", "model", "build", description, "--out", built], check=True)
    try:
        _, address, zenoh = stack.relay(store=f"folder://{tmp_path}/newest")
        stack.edge(zenoh, "--source", "wave:2", "--model", str(built))
        viewer = stack.viewer(address)
        watching = asyncio.create_task(viewer.watch())
        await viewer.until("the source's knee swings", lambda seen: len(knee_angles(seen)) > 5)
        kept = tmp_path / "newest/demo.public"
        await until_async("the store has a KEY", lambda: kept.is_file() and parse_header(kept.read_bytes()))
        await viewer.until("the model is there", lambda seen: any(map(model_of, seen.messages)))
        model = next(filter(None, map(model_of, viewer.messages)))
        watching.cancel()
        found = httpx.get(f"http://{address}/api/v1/robots/demo/model/{model}/manifest.json", trust_env=False)
        assert found.json()["links"] == [f"bone{i}" for i in range(BONES)]
    finally:
        for part in reversed(stack.parts):
            part.stop()


def knee_angles(viewer: Viewer) -> set[object]:
    return {frame.values("pos")[0] for _, frame in viewer.frames}


def model_of(message: dict[str, str]) -> str | None:
    return message.get({"hello": "model", "model": "hash"}.get(message["type"], ""))
