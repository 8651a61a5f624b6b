"""A mesh changes on disk: after a restart of the edge, the open pages learn about the new model."""

from __future__ import annotations

import asyncio
import hashlib
import struct
from pathlib import Path
from typing import Any

import httpx
import pytest

from .conftest import Stack, Viewer

URDF = """<robot name="r"><link name="base">
<visual><geometry><mesh filename="meshes/wedge.stl"/></geometry></visual></link></robot>"""


def wedge_stl(height: float) -> bytes:
    """A tetrahedron."""
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, height)]
    faces = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
    records = [struct.pack("<12fH", 0, 0, 0, *(v for i in face for v in points[i]), 0) for face in faces]
    return bytes(80) + struct.pack("<I", len(faces)) + b"".join(records)


def models_of(viewer: Viewer) -> list[str]:
    """Hashes it was told, in order."""
    of = {"hello": "model", "model": "hash"}
    told = (m[of[m["type"]]] for m in viewer.messages if m["type"] in of)
    return list(dict.fromkeys(digest for digest in told if digest))


async def height_of(address: str, digest: str) -> float:
    """The robot's, by the manifest that the relay serves under that hash."""
    base = f"http://{address}/api/v1/robots/demo/model/{digest}"
    async with httpx.AsyncClient(trust_env=False) as client:
        answer = await client.get(f"{base}/manifest.json")
        assert answer.status_code == 200
        assert hashlib.sha256(answer.content).hexdigest() == digest
        document: dict[str, Any] = answer.json()
        for file in document["files"]:
            content = (await client.get(f"{base}/{file['path']}")).content
            assert hashlib.sha256(content).hexdigest() == file["sha256"]
    return float(document["box"][1][2])


async def test_a_changed_mesh_reaches_open_pages(
    stack: Stack, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "robot"
    (folder / "meshes").mkdir(parents=True)
    (folder / "robot.urdf").write_text(URDF)
    (folder / "meshes/wedge.stl").write_bytes(wedge_stl(1.0))
    _, address, zenoh = stack.relay()
    arguments = ("--source", "demo", "--urdf", str(folder / "robot.urdf"))
    edge = stack.edge(zenoh, *arguments)
    viewer = stack.viewer(address)
    watching = asyncio.create_task(viewer.watch())
    await viewer.until("frames, the model or not", lambda v: len(v.frames) > 5)
    await viewer.until("the model", lambda v: len(models_of(v)) == 1, 60)
    assert await height_of(address, models_of(viewer)[0]) == pytest.approx(1.0, abs=1e-3)

    edge.stop()
    (folder / "meshes/wedge.stl").write_bytes(wedge_stl(2.0))
    stack.edge(zenoh, *arguments)
    await viewer.until("the changed model", lambda v: len(models_of(v)) == 2, 60)
    assert await height_of(address, models_of(viewer)[1]) == pytest.approx(2.0, abs=1e-3)
    assert viewer.connections == 1  # nobody reloaded anything
    watching.cancel()
