"""`run --urdf`: the robot is on air at once, its model is announced when it has been built beside it."""

from __future__ import annotations

import hashlib
import json
import logging
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from edge_stage import ROBOT, Edge, Router
from model_stage import cube_stl, joint, link, mesh, robot, written
from posecast_edge.model import finding
from posecast_edge.model.finding import advise_mesh_tools
from posecast_edge.model.serve.background import NEEDED, BackgroundBuild, describe_size
from posecast_edge.model.serve.bundle import Bundle, BundleFile, load_bundle
from posecast_testing import until
from posecast_wire.command_line.installation import name_edge_command
from posecast_wire.keys import Snapshot, model_key

Start = Callable[..., Edge]
RSS_KB_MAX = 80 << 10  # twice what it takes
FEET = """
[labels]
joint = ["A"]
[[fields]]
name = "pos"
[[fields]]
name = "ftf"
labels = ["RF.fz", "LF.fz"]
[sensors]
RF = { kind = "wrench", link = "right_foot" }
LF = { kind = "wrench", link = "a" }
[balance]
feet = ["RF", "LF", "lost"]
"""


@pytest.fixture(autouse=True)
def own_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()


def cube_robot(folder: Path) -> Path:
    return written(folder / "robot", robot(link("a", mesh("meshes/a.stl"))), a_stl=cube_stl())


def announced(router: Router) -> list[object]:
    return [e["hash"] for e in router.events if e["type"] == "model"]


def manifest_of(router: Router) -> bytes:
    [reply] = router.get(model_key(ROBOT, "manifest"))
    assert reply.ok is not None
    return reply.ok.payload.to_bytes()


def snapshot_model(router: Router) -> str | None:
    sample = router.snapshot()
    return Snapshot.unpack(sample.payload.to_bytes()).model if sample is not None else None


def memory_kb(pid: int, what: str = "VmHWM") -> int:
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(what))


def test_built_beside_the_frames(router: Router, edge: Start, tmp_path: Path) -> None:
    e = edge("--urdf", str(cube_robot(tmp_path)))
    e.send(t=1.0, pos={"RKN": 0.1})
    until("a frame", lambda: bool(router.frames))
    until("the model", lambda: bool(announced(router)), 60)
    manifest = manifest_of(router)
    digest = hashlib.sha256(manifest).hexdigest()
    assert announced(router) == [digest]
    assert snapshot_model(router) == digest
    document = json.loads(manifest)
    assert document["v"] == 2
    assert document["links"] == ["a"]
    for file in document["files"]:
        [reply] = router.get(model_key(ROBOT, file["sha256"]) + f"?off=0;len={file['size']}")
        assert reply.ok is not None
        assert hashlib.sha256(reply.ok.payload.to_bytes()).hexdigest() == file["sha256"]
    assert memory_kb(e.process.pid) < RSS_KB_MAX
    loaded = Path(f"/proc/{e.process.pid}/maps").read_text()
    assert "numpy" not in loaded, "what builds is loaded by another process"
    e.process.terminate()
    assert e.wait() == 0
    assert list((tmp_path / "tmp").iterdir()) == []  # nothing is left behind


def test_feet_of_the_profile_that_the_model_lacks_are_named_once(
    router: Router, edge: Start, tmp_path: Path
) -> None:
    """At the start already: no viewer sees what such a robot stands on, and the model may take a minute."""
    profile = tmp_path / "robot.toml"
    profile.write_text(FEET)
    e = edge("--urdf", str(cube_robot(tmp_path)), "--profile", str(profile))
    until("the model", lambda: bool(announced(router)), 60)
    e.process.terminate()
    assert e.wait() == 0
    told = [line for line in e.lines if "[balance]" in line]
    assert told == [
        "posecast-edge: profile: [balance] names feet that are not in the model: "
        "'RF' (on link 'right_foot'), 'lost'"
    ]
    built = next(i for i, line in enumerate(e.lines) if line.startswith("posecast-edge: model: "))
    assert e.lines.index(told[0]) < built


def test_stopped_while_it_builds(router: Router, edge: Start, tmp_path: Path) -> None:
    e = edge("--urdf", str(cube_robot(tmp_path)))
    until("the builder's folder", lambda: any((tmp_path / "tmp").iterdir()))
    e.process.terminate()
    assert e.wait(20) == 0
    assert list((tmp_path / "tmp").iterdir()) == []


class Ready:
    """What a build hands over."""

    def __init__(self) -> None:
        self.bundles: list[Bundle] = []
        self.came = threading.Event()

    def __call__(self, bundle: Bundle) -> None:
        self.bundles.append(bundle)
        self.came.set()


def test_without_the_mesh_tools_the_meshes_go_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setitem(sys.modules, NEEDED[0], None)
    path = cube_robot(tmp_path)
    raw, ready = load_bundle(path), Ready()
    build = BackgroundBuild(path, raw, ready)
    build.start()
    build.stop()
    assert ready.bundles == [raw]
    [record] = caplog.records
    assert advise_mesh_tools() in record.getMessage()
    assert "\n" not in record.getMessage()


def test_without_the_mesh_tools_nothing_is_said_of_meshes_where_there_are_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setitem(sys.modules, NEEDED[0], None)
    path, ready = written(tmp_path / "robot", robot(link("a"))), Ready()
    build = BackgroundBuild(path, load_bundle(path), ready)
    build.start()
    build.stop()
    assert len(ready.bundles) == 1
    assert caplog.records == []


def test_without_the_mesh_tools_what_is_wrong_is_counted_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setitem(sys.modules, NEEDED[0], None)
    path = written(tmp_path / "robot", robot(link("a"), joint("j", "nowhere", "a"), link("b")))
    build = BackgroundBuild(path, load_bundle(path), Ready())
    build.start()
    build.stop()
    [message] = [r.getMessage() for r in caplog.records]
    assert message == f"model: 2 errors; {name_edge_command('doctor')} --urdf {path} lists them"


@pytest.mark.parametrize("size", [(0, "0 kB"), (99_400, "99 kB"), (123_456, "0.1 MB"), (3_210_000, "3.2 MB")])
def test_sizes_of_models_are_never_0_megabytes(size: tuple[int, str]) -> None:
    file = BundleFile(Path("a.stl"), "a.stl", "a.stl", size[0], "")
    assert describe_size(Bundle(b"", [file], [], frozenset())) == size[1]


@pytest.mark.parametrize("fine", [True, False])
def test_an_agent_that_serves_a_coarser_model_says_so(
    fine: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(finding, "has_simplifier", lambda: fine)
    path = cube_robot(tmp_path)
    ready = Ready()
    build = BackgroundBuild(path, load_bundle(path), ready)
    build.start()
    assert ready.came.wait(60)
    build.stop()
    said = [r.getMessage() for r in caplog.records if "without meshoptimizer" in r.getMessage()]
    assert len(said) == (0 if fine else 1)
    if said:
        assert said[0].startswith("model: built without meshoptimizer, so it is coarser; ")


def test_what_can_t_be_built_goes_as_it_is(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = written(tmp_path / "robot", '<robot name="r"><joint name="j" type="fixed"/></robot>')
    raw, ready = load_bundle(path), Ready()
    build = BackgroundBuild(path, raw, ready)
    build.start()
    assert ready.came.wait(60)
    build.stop()
    assert ready.bundles == [raw]
    [message] = [r.getMessage() for r in caplog.records]
    assert message == f"model: not built, meshes are sent unchanged: {path}: it has no links"


def test_what_is_wrong_is_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    path = written(tmp_path / "robot", robot(link("a", mesh("meshes/gone.stl"))))
    ready = Ready()
    build = BackgroundBuild(path, load_bundle(path), ready)
    build.start()
    assert ready.came.wait(60)
    assert json.loads(ready.bundles[0].manifest)["v"] == 2
    assert ready.bundles[0].read("manifest", 0, 10) == ready.bundles[0].manifest[:10]
    build.stop()
    assert f"1 error; {name_edge_command('doctor')} --urdf {path} lists them" in caplog.text


def test_what_the_page_can_t_read_is_announced_when_it_has_been_built(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, ready = tmp_path / "robot.sdf", Ready()
    part = (
        "<link name='{0}'><visual name='v'><geometry><box><size>1 1 1</size></box></geometry></visual></link>"
    )
    head = "<sdf version='1.9' xmlns:xacro='http://www.ros.org/wiki/xacro'><model name='m'>"
    arg = "<xacro:arg name='n' default='leg'/>"
    path.write_text(head + arg + part.format("$(arg n)") + "</model></sdf>")
    build = BackgroundBuild(path, None, ready, ["--xacro-arg=n:=arm"])
    build.start()
    assert ready.came.wait(60)
    build.stop()
    assert json.loads(ready.bundles[0].manifest)["links"] == ["arm"]


def test_what_can_neither_be_built_nor_read_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path, ready = tmp_path / "robot.sdf", Ready()
    path.write_text("<sdf version='1.9'/>")
    failed = threading.Event()
    build = BackgroundBuild(path, None, ready, failed=failed.set)
    build.start()
    build._thread.join(60)
    build.stop()
    assert ready.bundles == []
    [message] = [r.getMessage() for r in caplog.records]
    assert message == f"model: not shown: {path}: it has no <model>"
    assert failed.is_set()
