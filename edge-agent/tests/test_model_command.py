"""`posecast-edge model build` and `doctor`, as they are called."""

from __future__ import annotations

import json
import os
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from command_stage import run_edge
from model_stage import cube_stl, joint, link, mesh, robot, written
from posecast_edge.cli.model_command import CLEAN, PROBLEMS, UNUSABLE, run_command
from posecast_edge.cli.profile_new import run_profile
from posecast_edge.model.serve.bundle_dir import ENTRIES, Cache, read_folder
from posecast_edge.model.urdf.resolver import Resolver

HEALTHY = robot(link("a"), link("b", mesh("meshes/b.stl")), joint("ab", "a", "b"))


def environment(tmp_path: Path) -> dict[str, str]:
    return {"XDG_CACHE_HOME": str(tmp_path / "cache")}


def test_build(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path / "model", HEALTHY, b_stl=cube_stl())
    out = tmp_path / "bundle"
    assert run_command(["model", "build", str(path), "-o", str(out)], environment(tmp_path)) == CLEAN
    said = capsys.readouterr()
    assert said.out.splitlines()[0] == f"{out}: 2 links, 2 visuals"
    assert said.err == ""
    files = read_folder(out)
    assert set(files) == {p.name for p in out.iterdir()} == {"manifest.json", "high.glb", "thumbnail.png"}


GONE = (
    ":3: error: mesh 'meshes/b.stl' of link 'b': no such file; looked for 'meshes/b.stl' "
    "and any 'b.stl' in the robot's folder [mesh-missing]"
)


def test_build_names_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path / "model", HEALTHY)
    out = tmp_path / "bundle"
    assert run_command(["model", "build", str(path), "-o", str(out)], environment(tmp_path)) == CLEAN
    said = capsys.readouterr()
    assert said.out.splitlines()[0] == f"{out}: 2 links, 2 visuals, 1 placeholder among them"
    assert said.err == f"{path}{GONE}\n"


def test_a_body_of_stand_ins_alone_is_a_problem(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path / "model", robot(link("a", mesh("meshes/b.stl"))))
    out = tmp_path / "bundle"
    for _ in range(2):  # the second time from the cache
        assert run_command(["model", "build", str(path), "-o", str(out)], environment(tmp_path)) == PROBLEMS
        said = capsys.readouterr().err.splitlines()
        assert said[1:] == [
            f"posecast-edge: {path}: no mesh was found, so only placeholders can be shown; "
            "give their folder with --package-path DIR"
        ]
        assert "high.glb" in read_folder(out)


@pytest.mark.parametrize(
    ("uri", "code", "said"),
    [
        ("meshes/b.stl", PROBLEMS, GONE),
        (
            "package://lemur/b.stl",
            PROBLEMS,
            ":3: error: mesh 'package://lemur/b.stl' of link 'b': no package",
        ),
        ("meshes/there.stl", CLEAN, ": robot 'r', 2 links, 1 joint: nothing wrong"),
    ],
)
def test_without_the_mesh_tools_the_doctor_sees_whether_meshes_are_there(
    uri: str, code: int, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setitem(sys.modules, "posecast_edge.model.builder.model_files", None)
    parts = (link("a"), link("b", mesh(uri)), joint("ab", "a", "b"))
    path = written(tmp_path / "model", robot(*parts), there_stl=cube_stl())
    assert run_command(["doctor", "--urdf", str(path)], {}) == code
    told = capsys.readouterr()
    assert told.out.startswith(f"{path}{said}")
    assert "checked only that mesh files exist, not their contents" in told.err


def test_cache_is_used_until_anything_changes(tmp_path: Path) -> None:
    path = written(tmp_path / "model", HEALTHY)
    out, cache = tmp_path / "bundle", tmp_path / "cache/posecast/models"

    def manifest() -> bytes:
        assert run_command(["model", "build", str(path), "-o", str(out)], environment(tmp_path)) == CLEAN
        assert len(list(cache.iterdir())) == 1
        return (out / "manifest.json").read_bytes()

    def spoil() -> None:
        """A marked entry shows whether it is used."""
        [entry] = cache.iterdir()
        document = json.loads((entry / "manifest.json").read_bytes())
        (entry / "manifest.json").write_text(json.dumps({**document, "robot": "from the cache"}))

    def used() -> bool:
        spoil()
        return b"from the cache" in manifest()

    without = manifest()
    assert used()
    (path.parent / "meshes/b.stl").write_bytes(cube_stl())  # now there is one
    assert not used()
    with_mesh = manifest()
    assert with_mesh != without
    assert used()
    (path.parent / "meshes/b.stl").write_bytes(cube_stl(0.3))
    assert not used()
    path.write_text(HEALTHY.replace('name="r"', 'name="s"'))
    assert not used()
    assert used()
    [entry] = cache.iterdir()
    (entry / "high.glb").write_bytes(b"")
    assert not used()
    assert (
        run_command(["model", "build", str(path), "-o", str(out), "--no-cache"], environment(tmp_path))
        == CLEAN
    )


def test_the_cache_is_bounded(tmp_path: Path) -> None:
    cache = tmp_path / "cache/posecast/models"
    paths = [written(tmp_path / f"m{i}", robot(link("a", ""))) for i in range(ENTRIES + 2)]
    for path in paths:
        kept = Cache(cache, path, [])
        kept.put({"manifest.json": b'{"v":2,"files":[]}'}, Resolver(path))
        os.utime(max(cache.iterdir(), key=lambda p: p.stat().st_ctime), (paths.index(path),) * 2)
    assert len(list(cache.iterdir())) == ENTRIES
    assert [Cache(cache, path, []).get() is not None for path in paths] == [False, False, *[True] * ENTRIES]


def test_cache_that_cannot_be_written(tmp_path: Path) -> None:
    path = written(tmp_path / "model", HEALTHY, b_stl=cube_stl())
    (tmp_path / "cache").write_text("a file")
    assert (
        run_command(["model", "build", str(path), "-o", str(tmp_path / "out")], environment(tmp_path))
        == CLEAN
    )


@pytest.mark.parametrize("command", ["doctor --urdf {}", "model build {} -o out"])
def test_links_in_a_circle_are_one_line(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    circle = tmp_path / "a.urdf"
    circle.symlink_to(circle)
    assert run_command(command.format(circle).split(), environment(tmp_path)) == UNUSABLE
    assert capsys.readouterr().err == f"posecast-edge: {circle}: Too many levels of symbolic links\n"


def test_a_user_without_a_home(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr("pwd.getpwuid", {}.__getitem__)
    path = written(tmp_path / "model", robot(link("a", mesh("package://model/gone.stl"))))
    assert run_command(["model", "build", str(path), "-o", str(tmp_path / "out")], {}) == PROBLEMS
    assert "no such file" in capsys.readouterr().err


@contextmanager
def full_disk() -> Iterator[None]:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_a_disk_that_is_full_leaves_the_old_bundle(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path / "model", HEALTHY, b_stl=cube_stl())
    out = tmp_path / "out"
    build = ["model", "build", "--no-cache", str(path), "-o", str(out)]
    with full_disk():
        assert run_command(build, {}) == UNUSABLE
    assert capsys.readouterr().err == f"posecast-edge: {out}: File too large\n"
    assert list(out.iterdir()) == []
    assert run_command(build, {}) == CLEAN
    whole = read_folder(out)
    path.write_text(HEALTHY.replace('name="r"', 'name="s"'))
    with full_disk():
        assert run_command(build, {}) == UNUSABLE
    assert read_folder(out) == whole
    assert not list(out.glob("*.part"))


def test_a_profile_is_written_whole_or_not_at_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, HEALTHY.replace("fixed", "continuous"), b_stl=cube_stl())
    out = tmp_path / "p.toml"
    with full_disk():
        assert run_profile(["new", "--urdf", str(path), "-o", str(out)]) == UNUSABLE
    assert capsys.readouterr().err == f"posecast-edge: {out}: File too large\n"
    assert not out.exists()


def test_a_folder_of_something_else_is_not_touched(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path / "model", HEALTHY, b_stl=cube_stl())
    before = sorted(path.parent.rglob("*"))
    for out in (path.parent, path):
        status = run_command(["model", "build", str(path), "-o", str(out)], environment(tmp_path))
        assert status == UNUSABLE
        assert len(capsys.readouterr().err.splitlines()) == 1
    assert sorted(path.parent.rglob("*")) == before


def test_an_old_bundle_is_replaced(tmp_path: Path) -> None:
    path = written(tmp_path / "model", HEALTHY, b_stl=cube_stl())
    out = tmp_path / "bundle"
    arguments = ["model", "build", str(path), "-o", str(out)]
    assert run_command(arguments, environment(tmp_path)) == CLEAN
    document = json.loads((out / "manifest.json").read_bytes())
    document["files"].append({"path": "old.glb", "size": 0, "sha256": "0" * 64, "type": "x"})
    (out / "manifest.json").write_text(json.dumps(document))
    (out / "old.glb").write_bytes(b"")
    (out / "mine.txt").write_bytes(b"")
    assert run_command(arguments, environment(tmp_path)) == CLEAN
    assert not (out / "old.glb").exists()
    assert (out / "mine.txt").exists()
    assert read_folder(out)


@pytest.mark.parametrize(
    ("text", "status", "first", "last"),
    [
        (robot(link("a")), CLEAN, "robot 'r', 1 link, 0 joints", "nothing wrong"),
        (robot(link("a"), link("b"), joint("j", "a", "b", inside="")), CLEAN, ":4: hint: ", "1 hint"),
        (robot(link("a"), link("b")), PROBLEMS, ":3: error: ", "1 error"),
        (robot(link("a", "<visual/>")), PROBLEMS, "warning: ", "2 warnings"),
    ],
)
def test_doctor(
    text: str, status: int, first: str, last: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, text)
    assert run_command(["doctor", "--urdf", str(path)], {}) == status
    lines = capsys.readouterr().out.splitlines()
    assert first in lines[0]
    assert lines[-1].endswith(last)
    assert all(line.startswith(str(path)) for line in lines)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["doctor", "--urdf", "{}/gone.urdf"], "gone.urdf: No such file"),
        (["doctor", "--urdf", "{}"], "is not a file"),
        (["doctor"], "give --urdf, --profile, --source, --relay, or several of them"),
        (["doctor", "--urdf", "{}/robot.urdf", "--profile", "{}/gone.toml"], "gone.toml"),
        (["model"], "required"),
        (["model", "build", "{}/robot.urdf"], "required"),
        (["model", "build", "{}/bomb.urdf", "-o", "{}/out"], "bomb.urdf:1: a document type"),
        (["model", "build", "{}/empty.urdf", "-o", "{}/out"], "no link"),
    ],
)
def test_unusable(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(tmp_path, robot(link("a")))
    (tmp_path / "bomb.urdf").write_text('<!DOCTYPE r [<!ENTITY a "b">]><robot/>')
    (tmp_path / "empty.urdf").write_text("<robot/>")
    status = run_command([a.format(tmp_path) for a in arguments], environment(tmp_path))
    said = capsys.readouterr()
    assert status == UNUSABLE
    assert said.out == ""
    assert words in said.err
    assert len(said.err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_doctor_reads_the_profile(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, robot(link("a"), link("b"), joint("ab", "a", "b")))
    profile = tmp_path / "p.toml"
    profile.write_text(
        '[robot]\nname = "r"\n[labels]\njoint = ["ab"]\n[[fields]]\nname = "pos"\nlabels = "joint"\n'
        '[[fields]]\nname = "ftf"\nlabels = ["RF.fz"]\n[sensors.RF]\nkind = "wrench"\nlink = "gone"\n'
    )
    assert run_command(["doctor", "--urdf", str(path), "--profile", str(profile)], {}) == PROBLEMS
    assert "mounts sensor 'RF' on link 'gone'" in capsys.readouterr().out
    assert run_command(["doctor", "--profile", str(profile)], {}) == CLEAN, "alone it is well"
    assert capsys.readouterr().out == f"{profile}: 2 fields, 2 channels: nothing wrong\n"
    profile.write_text('[[fields]]\nname = "pos"\nunnit = "rad"\n')
    assert run_command(["doctor", "--profile", str(profile)], {}) == UNUSABLE
    assert "p.toml:3: fields[0].unnit: unknown key" in capsys.readouterr().err


def test_as_a_program_without_traces_of_a_terminal(tmp_path: Path) -> None:
    path = written(tmp_path, robot(link("a"), link("b\x1b".replace("\x1b", "&#x9b;"))))
    done = run_edge("doctor", "--urdf", str(path))
    assert done.returncode == PROBLEMS
    assert done.stderr == ""
    assert all(line.isprintable() for line in done.stdout.splitlines())
