"""Balance in the state of a robot: of the newest frame, at a bounded rate, whatever a model says."""

from __future__ import annotations

import asyncio
import hashlib
import json
import re
from pathlib import Path
from typing import Any, get_args

import httpx
import pytest
from posecast_relay.balance.balance import BalanceGap
from posecast_relay.balance.model import BalanceModel, read_balance_model
from posecast_relay.core.state.stream import Stream
from posecast_relay.http.balance_models import NoBalance
from posecast_relay.http.robot_state import StateReader
from posecast_relay.http.state_balance import LINK_US, ROBOT_US_PER_S, US_PER_S
from posecast_relay.streaming.decode_cache import DecodeCache
from posecast_testing import until
from posecast_wire import Schema

from .balance_stage import WEIGHT_N, make_codes, make_manifest, make_model, make_schema_text
from .sim import World
from .stage import Model


def read_state(
    model: BalanceModel | NoBalance | None, text: str | None = None, **values: float | None
) -> dict[str, Any]:
    """The document of a frame."""
    world, schema = World(), Schema.parse(text or make_schema_text())
    edge = world.on_air(schema)
    world.publish(edge, edge.frame(world.now, make_codes(schema, **values)))
    robot = world.hub.robots["r"]
    reader = StateReader(lambda: world.now, DecodeCache(lambda: world.now))
    found: dict[str, Any] = json.loads(reader.read(robot, robot.rooms["public"], 60.0, model))
    return found


def test_a_state_tells_the_balance_of_its_frame() -> None:
    half_n = round(WEIGHT_N / 2, 1)
    assert read_state(make_model())["balance"] == {
        "mass_kg": 40.0,
        "centre_of_mass_m": [0.02, 0.0, 1.0],
        "ground": "measured",
        "floor_m": 0.0,
        "support_polygon_m": [[-0.08, -0.15], [0.12, -0.15], [0.12, 0.15], [-0.08, 0.15]],
        "margin_mm": 100.0,
        "centre_of_pressure_m": [0.0, 0.0, 0.0],
        "feet": {
            "RF": {"bears": True, "force_n": half_n, "centre_of_pressure_m": [0.0, -0.1, 0.0]},
            "LF": {"bears": True, "force_n": half_n, "centre_of_pressure_m": [0.0, 0.1, 0.0]},
        },
        "why": {},
    }


def test_what_is_none_is_null_and_says_why() -> None:
    found = read_state(make_model(inertials=[]), RF_fz=None)["balance"]
    nulls = {
        "mass_kg",
        "centre_of_mass_m",
        "floor_m",
        "support_polygon_m",
        "margin_mm",
        "centre_of_pressure_m",
    }
    assert {name for name, value in found.items() if value is None} == nulls
    assert found["feet"]["RF"] == {"bears": None, "force_n": None, "centre_of_pressure_m": None}
    assert found["why"] == {
        "centre_of_mass_m": "no-masses",
        "support_polygon_m": "unread",
        "margin_mm": "no-masses",
        "centre_of_pressure_m": "unread",
    }


def test_without_a_joint_that_carries_a_foot_there_is_no_number_and_its_name() -> None:
    found = read_state(make_model(), left_leg=None)["balance"]
    parts = {"centre_of_mass_m", "support_polygon_m", "margin_mm", "centre_of_pressure_m"}
    assert found["why"] == dict.fromkeys(parts, "joint-unread")
    assert [found[part] for part in parts] == [None] * 4
    assert found["detail"] == "no reading of left_leg"


def test_a_joint_that_copies_another_needs_no_reading() -> None:
    joints = make_manifest()["joints"]
    joints[2]["mimic"] = {"joint": 0, "multiplier": 1.0, "offset": 0.0}
    found = read_state(make_model(joints=joints), left_leg=None)["balance"]
    assert (found["margin_mm"], found["why"]) == (100.0, {})


def test_a_robot_without_a_model_or_without_masses_and_feet_has_no_member() -> None:
    assert "balance" not in read_state(None)
    assert "balance" not in read_state(make_model(inertials=[], soles=[]))
    assert read_state(make_model(soles=[]))["balance"]["why"]["margin_mm"] == "no-feet"


@pytest.mark.parametrize(
    ("model", "told"),
    [
        (NoBalance("model-away"), {"why": {"balance": "model-away"}}),
        (NoBalance("bad-model", "v: 3"), {"why": {"balance": "bad-model"}, "detail": "v: 3"}),
        (make_model(inertials=None, soles=None), {"why": {"balance": "old-bundle"}}),
        (
            make_model(inertials=[], soles=[], findings=[{"code": "mass-zero"}]),
            {"why": {"balance": "impossible-masses"}},
        ),
        (
            make_model(inertials=7, soles=[]),
            {"why": {"balance": "bad-model"}, "detail": "inertials: no list"},
        ),
    ],
)
def test_where_there_is_none_it_says_why(model: BalanceModel | NoBalance, told: dict[str, Any]) -> None:
    assert read_state(model)["balance"] == told


def test_what_of_a_model_can_be_read_counts_and_what_cant_is_told() -> None:
    found = read_state(make_model(soles=[{}]))["balance"]
    assert (found["mass_kg"], found["detail"]) == (40.0, "soles[0]: its link is not there")
    assert found["why"]["support_polygon_m"] == "old-bundle"


def test_a_view_has_what_its_own_fields_allow() -> None:
    no_forces = read_state(make_model(), make_schema_text(fields=("pos", "base", "baseq")))["balance"]
    assert (no_forces["ground"], no_forces["centre_of_pressure_m"]) == ("lowest", None)
    assert no_forces["why"] == {"centre_of_pressure_m": "no-wrench"}
    assert {foot["force_n"] for foot in no_forces["feet"].values()} == {None}
    no_positions = read_state(make_model(), make_schema_text(fields=("ftf", "ftm")))["balance"]
    assert no_positions == {"why": {"balance": "no-positions"}}
    unread = read_state(make_model(), right_leg=None, left_leg=None)["balance"]
    assert unread == {"why": {"balance": "no-positions"}}


def make_huge(links: int) -> BalanceModel:
    """A chain of so many links."""
    joints = [{"name": f"j{i}", "type": "revolute", "parent": i, "child": i + 1} for i in range(links - 1)]
    masses = [{"link": i, "mass_kg": 1, "xyz": [0, 0, 0], "inertia": [0] * 6} for i in range(links)]
    manifest = make_manifest(links=[f"l{i}" for i in range(links)], joints=joints, inertials=masses, soles=[])
    return read_balance_model(json.dumps(manifest).encode())


def test_a_huge_model_has_its_share_and_its_fields_are_told_at_every_rate() -> None:
    world, schema, model = World(), Schema.parse(make_schema_text()), make_huge(1000)
    edge = world.on_air(schema)
    robot = world.hub.robots["r"]
    reader = StateReader(lambda: world.now, DecodeCache(lambda: world.now))
    told, seqs = [], set[int]()
    for _ in range(40):
        world.pass_time(0.1)
        world.publish(edge, edge.frame(world.now, make_codes(schema)))
        doc = json.loads(reader.read(robot, robot.rooms["public"], 60.0, model))
        seqs.add(doc["seq"])
        told.append(doc["balance"]["why"].get("balance"))
    assert len(seqs) == 40
    computed = told.count(None)
    assert 1 <= computed <= 1 + 4.1 * ROBOT_US_PER_S / (1000 * LINK_US)
    assert told.count("busy") == 40 - computed


def test_a_state_that_is_asked_for_often_is_computed_ten_times_a_second(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from posecast_relay.http import state_balance

    computed: list[Stream] = []
    whole = state_balance.StateBalance.make_document

    def counted(self: Any, stream: Stream, *more: Any) -> Any:
        computed.append(stream)
        return whole(self, stream, *more)

    monkeypatch.setattr(state_balance.StateBalance, "make_document", counted)
    world, schema, model = World(), Schema.parse(make_schema_text()), make_model()
    edge = world.on_air(schema)
    robot = world.hub.robots["r"]
    reader = StateReader(lambda: world.now, DecodeCache(lambda: world.now))
    for _ in range(60):
        world.pass_time(1 / 60)
        world.publish(edge, edge.frame(world.now, make_codes(schema)))
        reader.read(robot, robot.rooms["public"], 60.0, model)
    assert 8 <= len(computed) <= 11


class Bundle(Model):
    """A model of nothing but a manifest."""

    def __init__(self, manifest: object) -> None:
        super().__init__({})
        self.manifest = json.dumps(manifest).encode()
        self.digest = hashlib.sha256(self.manifest).hexdigest()


async def test_a_relay_tells_it_on_request_and_fetches_no_model_before(relays: Any, edges: Any) -> None:
    relay = relays()
    schema = Schema.parse(make_schema_text())
    whole, bad = Bundle(make_manifest()), Bundle(make_manifest(links=[]))
    edges(relay.zenoh, of=schema, model=whole)
    edges(relay.zenoh, robot="bad", of=schema, model=bad)
    url = f"http://{relay.address}/api/v1/robots"
    await asyncio.to_thread(until, "both", lambda: len(httpx.get(url).json()["robots"]) == 2)
    assert (whole.asked, bad.asked) == ([], [])

    def tell(robot: str, member: str) -> bool:
        answer = httpx.get(f"{url}/{robot}/state")
        return answer.status_code == 200 and member in answer.json().get("balance", {})

    await asyncio.to_thread(until, "a balance", lambda: tell("r", "mass_kg"))
    assert httpx.get(f"{url}/r/state").json()["balance"]["mass_kg"] == 40
    await asyncio.to_thread(until, "a reason", lambda: tell("bad", "detail"))
    told = httpx.get(f"{url}/bad/state").json()["balance"]
    assert told == {"why": {"balance": "bad-model"}, "detail": "links: none"}
    assert (whole.asked, bad.asked) == (["manifest"], ["manifest"])


PAGE = (Path(__file__).resolve().parents[2] / "docs" / "reference/protocol.md").read_text()


def test_the_docs_show_the_members_there_are_and_tell_every_reason() -> None:
    blocks = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
    (sample,) = [json.loads(block)["balance"] for block in blocks if '"balance"' in block]
    found = read_state(make_model())["balance"]
    assert sample.keys() == found.keys()
    assert sample["feet"]["RF"].keys() == found["feet"]["RF"].keys()
    section = PAGE[PAGE.index("### Balance") :]
    for member in sample:
        assert f"`{member}`" in section
    codes = {*get_args(BalanceGap)} - {"first-pose"}
    for code in codes | {"no-positions", "model-away", "bad-model", "busy"}:
        assert f"`{code}`" in section, code
    assert f"{ROBOT_US_PER_S / 1e4:g} % of a core for one robot, {US_PER_S / 1e4:g} % for all" in section
