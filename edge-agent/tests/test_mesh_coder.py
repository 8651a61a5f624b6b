"""Models are built where meshoptimizer is missing, too: coarser, and that is said."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from model_stage import glb_document
from numpy.typing import NDArray
from posecast_edge.model.builder import mesh_coder
from posecast_edge.model.builder.mesh_coder import simplify
from posecast_edge.model.finding import advise_mesh_tools

WITHOUT = "import sys; sys.modules['meshoptimizer'] = None; from posecast_edge.cli.main import main; main()"
DEMO = Path(mesh_coder.__file__).parents[2] / "demo_bundle" / "robot.urdf"


@pytest.fixture(autouse=True)
def without_meshoptimizer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_coder, "meshoptimizer", None)


def sphere(rings: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Faces and vertices of a ball of radius 1 m; its poles are open."""
    columns = 2 * rings
    down, around = np.meshgrid(np.linspace(0.1, np.pi - 0.1, rings), np.arange(columns) * 2 * np.pi / columns)
    places = np.stack([np.sin(down) * np.cos(around), np.sin(down) * np.sin(around), np.cos(down)], axis=-1)
    faces = []
    for i in range(columns):
        for j in range(rings - 1):
            a, b = i * rings + j, (i + 1) % columns * rings + j
            faces += [(a, a + 1, b), (b, a + 1, b + 1)]
    return np.array(faces, np.int32), places.reshape(-1, 3)


@pytest.mark.parametrize("error", [0.005, 0.02, 0.08])
def test_a_ball_stays_round_within_the_error(error: float) -> None:
    faces, places = sphere(100)
    coarse = simplify(faces, places, None, error, keeps_border=False)
    assert len(coarse) < len(faces) / 3
    middles = places[coarse].mean(axis=1)
    assert np.abs(np.linalg.norm(middles, axis=1) - 1).max() <= error
    # and it is still all there: some vertex is near each of the old ones
    left = places[np.unique(coarse)]
    reach = max(np.linalg.norm(left - place, axis=1).min() for place in places[::50])
    assert reach < error * 2**mesh_coder.DOUBLINGS


def test_less_error_leaves_more_triangles() -> None:
    faces, places = sphere(60)
    counts = [len(simplify(faces, places, None, error, keeps_border=False)) for error in (0.001, 0.01, 0.1)]
    assert counts == sorted(counts, reverse=True)
    assert len(set(counts)) == 3


def test_a_border_that_others_share_stays() -> None:
    faces, places = sphere(60)
    border = set(np.flatnonzero(np.abs(places[:, 2]) > 0.994))
    assert border
    assert border <= set(np.unique(simplify(faces, places, None, 0.05, keeps_border=True)))
    assert not border <= set(np.unique(simplify(faces, places, None, 0.05, keeps_border=False)))


def test_distant_places_of_a_texture_are_not_joined() -> None:
    faces, places = sphere(30)
    uv = np.zeros((len(places), 2))
    uv[places[:, 0] > 0, 0] = 0.9
    coarse = simplify(faces, places, uv, 3.0, keeps_border=False)
    assert {float(u) for u in uv[np.unique(coarse), 0]} == {0.0, 0.9}


def build(out: Path, cache: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", WITHOUT, "model", "build", str(DEMO), "-o", str(out)]
    environment = os.environ | {"XDG_CACHE_HOME": str(cache)}
    return subprocess.run(command, capture_output=True, env=environment, text=True, timeout=120, check=True)


def test_a_robot_is_built_alike_and_the_loss_is_said_in_one_line(tmp_path: Path) -> None:
    """Also of one that was built before: the second comes from the first one's cache, the third does not."""
    builds = [
        build(tmp_path / name, tmp_path / cache) for name, cache in (("a", "x"), ("b", "x"), ("c", "y"))
    ]
    assert len({built.stderr for built in builds}) == 1
    said = [line for line in builds[0].stderr.splitlines() if "meshoptimizer" in line]
    assert len(said) == 1
    assert said[0].startswith(f"posecast-edge: {DEMO}: built without meshoptimizer, so it is coarser; ")
    (manifest,) = {(tmp_path / name / "manifest.json").read_bytes() for name in "abc"}
    levels = json.loads(manifest)["levels"]
    assert levels[0]["triangles"] < levels[-1]["triangles"] / 2
    for level in levels:
        data = (tmp_path / "a" / level["path"]).read_bytes()
        document = glb_document(data)
        assert document["extensionsRequired"] == ["KHR_mesh_quantization"]
        assert len(document["buffers"]) == 1
        whole = document["buffers"][0]["byteLength"]
        assert all(v["byteOffset"] + v["byteLength"] <= whole for v in document["bufferViews"])


@pytest.mark.parametrize(
    ("error", "said"),
    [
        ("ModuleNotFoundError('no PIL')", f"needs the mesh tools: {advise_mesh_tools()}"),
        (
            "ImportError('libstdc++.so.6: cannot open')",
            "the mesh tools can't be loaded: libstdc++.so.6: cannot open",
        ),
    ],
)
def test_tools_that_are_there_and_do_not_load_are_told_from_missing_ones(error: str, said: str) -> None:
    program = f"""
import sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "PIL":
            raise {error}
sys.meta_path.insert(0, Finder())
from posecast_edge.cli.main import main
main()
"""
    command = [sys.executable, "-c", program, "model", "build", "--no-cache", str(DEMO), "-o", "/nowhere"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert ended.returncode == 2
    assert ended.stderr.startswith(f"posecast-edge: {DEMO}: {said}")
