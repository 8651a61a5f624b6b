"""Models in an object store: stored once, verified, bounded, served to who may see a past that names them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import httpx
import pytest
from posecast_relay.archive.models import JoinedModelSource, ModelKeeper, make_model_key
from posecast_relay.core.policy import Audience, Rule
from posecast_relay.models.cache import Absent, ModelCache, Unavailable
from posecast_testing import until_async

from .archive_world import ArchiveWorld, make_run
from .past_doors import PAGE_MS, PastDoors
from .stage import Model

FILES = {"robot.urdf": (b"<robot/>" * 9, "application/xml"), "meshes/a b.glb": (b"glTF" * 99_999, "")}


class Edge:
    """A ModelSource, as an edge that may be away, or have another model by now."""

    def __init__(self, *models: Model) -> None:
        self.models: Mapping[str, Model] = {model.digest: model for model in models}
        self.is_away = False
        self.asked = 0

    def offers(self, _robot: str, digest: str) -> bool:
        """What it announces."""
        return digest in self.models

    async def fetch_manifest(self, _robot: str, digest: str) -> bytes:
        """The manifest."""
        return self._answer(digest).manifest

    async def read(self, _robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:
        """A part of a file."""
        return self._answer(digest).files[sha256][off : off + size]

    def _answer(self, digest: str) -> Model:
        self.asked += 1
        if self.is_away:
            raise Unavailable("the robot's agent does not answer")
        return self.models[digest]


class Keeping:
    """A keeper that fetches from an edge, and its clock."""

    def __init__(self, world: ArchiveWorld, edge: Edge, bytes_max: int = 64 << 20) -> None:
        self.now, self.world = 0.0, world
        models = ModelCache(edge, 1 << 26, lambda: self.now)
        self.keeper = ModelKeeper(world.store, models, lambda: self.now, bytes_max)
        self.keeper.set_robots(("r",))

    async def keep(self, digest: str, robot: str = "r") -> None:
        """A segment that names a model, and what comes of it."""
        self.keeper.keep(make_run(1, robot=robot, model=digest)[0])
        await until_async("it is done", lambda: not self.keeper.find_storing(robot))


def make_cache(world: ArchiveWorld, edge: Edge) -> ModelCache:
    """What a relay that has just begun serves models from."""
    return ModelCache(JoinedModelSource(edge, world.store), 1 << 26)


async def test_a_model_is_stored_once_and_served_when_its_edge_is_away(tmp_path: Path) -> None:
    world, model = ArchiveWorld(tmp_path), Model(FILES)
    edge = Edge(model)
    keeping = Keeping(world, edge)
    await keeping.keep(model.digest, "q")
    assert edge.asked == 0  # nobody has decided to keep that one
    await keeping.keep(model.digest)
    assert world.list_files() == sorted(
        f"r/models/{model.digest}/{path}" for path in (*FILES, "manifest.json")
    )
    asked = edge.asked
    await keeping.keep(model.digest)
    assert (edge.asked, keeping.keeper.stored) == (asked, 1)
    await Keeping(world, edge).keep(model.digest)  # another process
    assert edge.asked == asked
    for away in (True, False):  # it does not answer, or has another model
        edge.is_away = away
        if not away:
            edge.models = {}
        models = make_cache(world, edge)
        assert models.find_data((await models.load_manifest("r", model.digest)).name) == model.manifest
        for path, (data, _) in FILES.items():
            assert models.find_data((await models.load_file("r", model.digest, path)).name) == data
        with pytest.raises((Absent, Unavailable)):
            await models.load_manifest("q", model.digest)
    edge.models = {model.digest: Model({"other": (b"", "")})}  # it says so, and has another one already
    await make_cache(world, edge).load_file("r", model.digest, "robot.urdf")
    with pytest.raises(Absent):
        await make_cache(world, edge).load_manifest("r", "0" * 64)


async def test_what_is_damaged_in_the_store_is_not_served(tmp_path: Path) -> None:
    world, model, edge = ArchiveWorld(tmp_path), Model(FILES), Edge()
    edge.models = {model.digest: model}
    await Keeping(world, edge).keep(model.digest)
    edge.models = {}
    (tmp_path / make_model_key("r", model.digest, "robot.urdf")).write_bytes(b"<ROBOT/>" * 9)
    models = make_cache(world, edge)
    with pytest.raises(Unavailable, match="does not match its manifest"):
        await models.load_file("r", model.digest, "robot.urdf")
    await models.load_file("r", model.digest, "meshes/a b.glb")
    (tmp_path / make_model_key("r", model.digest, "manifest.json")).write_bytes(b"{}")
    with pytest.raises(Absent):
        await make_cache(world, edge).load_manifest("r", model.digest)
    edge.models = {model.digest: model}  # a keeper mends it
    await Keeping(world, edge).keep(model.digest)
    edge.models = {}
    await make_cache(world, edge).load_file("r", model.digest, "robot.urdf")


async def test_a_model_that_does_not_fit_is_not_stored_and_one_line_says_so(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = ArchiveWorld(tmp_path)
    first, second = Model(FILES), Model({"b.glb": (b"y" * 300_000, "")})
    keeping = Keeping(world, Edge(first, second), 500_000)
    await keeping.keep(first.digest)
    for _ in range(3):
        await keeping.keep(second.digest)
    assert keeping.keeper.stored == 1
    assert caplog.text.count(" is not kept: ") == 1
    assert not [file for file in world.list_files() if second.digest in file]


async def test_an_edge_that_is_away_is_asked_again_and_nothing_is_left_half(tmp_path: Path) -> None:
    world, model = ArchiveWorld(tmp_path), Model(FILES)
    edge = Edge(model)
    edge.is_away = True
    keeping = Keeping(world, edge)
    await keeping.keep(model.digest)
    asked = edge.asked
    await keeping.keep(model.digest)
    assert edge.asked == asked  # not for a while
    assert world.list_files() == []
    edge.is_away = False
    keeping.now += 60
    await keeping.keep(model.digest)
    assert keeping.keeper.stored == 1
    keeping.keeper.forget("r")
    for file in world.list_files():
        (tmp_path / file).unlink()
    await keeping.keep(model.digest)
    assert keeping.keeper.stored == 2


async def test_a_stored_model_is_for_who_may_see_a_past_that_names_it(tmp_path: Path) -> None:
    world, model, edge = ArchiveWorld(tmp_path), Model(FILES), Edge()
    edge.models = {model.digest: model}
    await Keeping(world, edge).keep(model.digest)
    edge.models = {}
    staff = frozenset({Audience.SIGNED_IN})
    await world.write(*make_run(2, PAGE_MS, model=model.digest, audiences=staff))
    await world.index()
    world.unix_ms = PAGE_MS + 86_400_000
    rule = Rule("public", past_s=10 * 86_400.0)
    doors = PastDoors(
        {"r": {Audience.ANYONE: rule, Audience.SIGNED_IN: rule}},
        world.make_doors(None).source,
        models=make_cache(world, edge),
        has_models=True,
    )
    doors.unix_ms = world.unix_ms
    await doors.start()
    try:
        path = f"/r/model/{model.digest}/robot.urdf"

        async def ask(token: str | None = None) -> httpx.Response:
            answer: httpx.Response = await doors.ask(path, token)
            return answer

        assert (await ask()).status_code == 404
        answer = await ask("somebody")
        assert (answer.status_code, answer.content) == (200, FILES["robot.urdf"][0])
        assert answer.headers["cache-control"] == "no-store"
        assert (await ask()).status_code == 404  # also now that it is in memory
        short = Rule("public", past_s=3600.0)
        doors.allow({"r": {Audience.SIGNED_IN: short, Audience.ANYONE: rule}})
        assert (await ask("somebody")).status_code == 404
        world.unix_ms = doors.unix_ms
        await world.write(*make_run(1, PAGE_MS + 3_600_000, model=model.digest, take=7))
        await world.index()
        world.now += 1000
        doors.source._reader.forget("r")  # type: ignore[union-attr]
        open_ = await ask()
        assert (open_.status_code, open_.headers["cache-control"]) == (200, "public, max-age=3600")
    finally:
        await doors.stop()
