"""Source `rosbridge` against a WebSocket server that speaks its protocol, for better and worse."""

from __future__ import annotations

import json
import logging
import re
import socket
import threading
from collections.abc import Callable, Iterator
from typing import Any

import cbor2
import pytest
from posecast_edge.sources.ros import rosbridge as rosbridge_module
from posecast_edge.sources.ros.messages import DIAGNOSTICS, JOINT_STATE
from posecast_testing import free_port, until
from rosbridge_stage import Rosbridge, joint_state, ros_1, ros_2
from source_stage import Listen, Move, Mover, flood
from websockets.utils import accept_key

NAMES = ["hip", "knee"]
PROFILE = """
[labels]
joint = ["hip", "knee"]
[[fields]]
name = "pos"
"""
CBOR = PROFILE + '[ros]\nencoding = "cbor"\n'
TOPICS = {"/joint_states": ros_2(JOINT_STATE), "/camera": "sensor_msgs/msg/Image"}


@pytest.fixture
def bridge() -> Iterator[Callable[..., Rosbridge]]:
    started: list[Rosbridge] = []

    def start(topics: dict[str, str] = TOPICS, **how: Any) -> Rosbridge:
        started.append(Rosbridge(topics, **how))
        return started[-1]

    yield start
    for one in started:
        one.stop()


@pytest.mark.parametrize("profile", [PROFILE, CBOR], ids=["json", "cbor"])
@pytest.mark.parametrize("version", [ros_1, ros_2])
def test_either_ros_in_either_encoding(
    version: Callable[[str], str],
    profile: str,
    bridge: Callable[..., Rosbridge],
    listen: Listen,
    moving: Move,
) -> None:
    server = bridge({"/joint_states": version(JOINT_STATE), "/camera": version("sensor_msgs/Image")})
    heard = listen(server.source, profile)
    moving(50, lambda t: server.publish("/joint_states", joint_state(9 + t, NAMES, [t, 2.0], version)))
    until("samples", lambda: len(heard.samples) > 10)
    t_s, values = heard.last
    assert values["pos"]["knee"] == 2.0
    assert t_s == pytest.approx(9 + values["pos"]["hip"], abs=1e-6)
    assert server.subscribed == {"/joint_states"}
    (wish,) = [w for w in server.asked if w["op"] == "subscribe"]
    assert wish["type"] == version(JOINT_STATE)
    assert (wish["throttle_rate"], wish["queue_length"]) == (rosbridge_module.THROTTLE_MS, 1)
    assert {w["op"] for w in server.asked} == {"subscribe", "call_service"}
    services = {w["service"] for w in server.asked if w["op"] == "call_service"}
    assert services <= {"/rosapi/topics", "/rosapi/publishers", "/rosapi/get_param"}


@pytest.mark.parametrize("type_name", ["tf2_msgs/TFMessage", "tf/tfMessage"])
def test_the_base_by_transforms(
    type_name: str, bridge: Callable[..., Rosbridge], listen: Listen, moving: Move
) -> None:
    server = bridge({"/joint_states": JOINT_STATE, "/tf": type_name, "/tf_static": type_name})
    heard = listen(server.source, PROFILE + '[ros]\nbase = "odom->base_link"\n')
    zero, level = dict.fromkeys("xyz", 0.0), {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}

    def act(t_s: float) -> None:
        server.publish("/joint_states", joint_state(9 + t_s, NAMES, [t_s, 2.0], ros_1))
        stamp = {"secs": 9, "nsecs": round(t_s * 1e9) % 10**9}
        moved = {
            "header": {"seq": 3, "stamp": stamp, "frame_id": "/odom"},
            "child_frame_id": "base_link",
            "transform": {"translation": zero | {"x": 2.5}, "rotation": level},
        }
        server.publish("/tf", {"transforms": [moved]})

    moving(50, act)
    until("base", lambda: "base" in heard.newest)
    assert heard.newest["base"] == {"base.x": 2.5, "base.y": 0, "base.z": 0}
    wishes = {w["topic"]: w for w in server.asked if w["op"] == "subscribe"}
    assert wishes["/tf"]["type"] == type_name
    assert "throttle_rate" not in wishes["/tf"]  # it would drop what another frame's message says


def test_the_last_value_before_a_pause_arrives(bridge: Callable[..., Rosbridge], listen: Listen) -> None:
    server = bridge()
    heard = listen(server.source, PROFILE)
    until("a subscription", lambda: server.subscribed == {"/joint_states"})
    for burst in range(3):
        for k in range(200):  # far faster than the throttle
            server.publish("/joint_states", joint_state(1 + burst + k / 1000, NAMES, [burst, k]))
        until("the last of a burst", lambda: heard.newest.get("pos") == {"hip": burst, "knee": 199})  # noqa: B023
    assert server.sent < 300  # most were never sent


def test_a_topic_of_two_publishers_is_not_throttled(bridge: Callable[..., Rosbridge], listen: Listen) -> None:
    """Else the second, always a moment later, would push the first out of the queue of one."""
    server = bridge()
    server.publishers["/joint_states"] = 2
    heard = listen(server.source, PROFILE)
    until("a subscription", lambda: server.subscribed == {"/joint_states"})
    assert "throttle_rate" not in next(w for w in server.asked if w["op"] == "subscribe")

    def both(t_s: float) -> None:
        server.publish("/joint_states", joint_state(1 + t_s, ["hip"], [1.0]))
        server.publish("/joint_states", joint_state(1 + t_s, ["knee"], [2.0]))

    mover = Mover(200, both)
    until("both", lambda: heard.newest.get("pos") == {"hip": 1.0, "knee": 2.0})
    mover.end()


def test_fragments(bridge: Callable[..., Rosbridge], listen: Listen, moving: Move) -> None:
    server = bridge()
    server.fragment = 50
    heard = listen(server.source, PROFILE)
    moving(50, lambda t: server.publish("/joint_states", joint_state(1 + t, NAMES, [1.0, 2.0])))
    until("a message put together", lambda: heard.newest.get("pos") == {"hip": 1.0, "knee": 2.0})


def test_a_server_that_dies_and_comes_back(
    bridge: Callable[..., Rosbridge], listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "posecast_edge")
    port = free_port()
    heard = listen(f"rosbridge://127.0.0.1:{port}", PROFILE)
    until("a word", lambda: any("still trying" in r.getMessage() for r in caplog.records))

    def live(life: float) -> None:
        server = bridge(port=port)
        until("a subscription", lambda: server.subscribed == {"/joint_states"})
        state = joint_state(life * 100, NAMES, [life, 0])
        mover = Mover(50, lambda _: server.publish("/joint_states", state))
        until("positions of this life", lambda: heard.newest.get("pos", {}).get("hip") == life)
        mover.end()
        server.stop()

    live(1.0)
    live(2.0)
    told = [r.getMessage() for r in caplog.records if "still trying" in r.getMessage()]
    assert len(told) <= 4, told


def test_a_server_that_hangs_is_told_once_without_a_traceback(
    listen: Listen, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rosbridge_module, "PING_S", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(10)
        listen(f"rosbridge://127.0.0.1:{server.getsockname()[1]}", PROFILE)
        link, _ = server.accept()
        with link:
            key = re.search(rb"Sec-WebSocket-Key: (\S+)", link.recv(4096))
            assert key is not None
            upgrade = "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            link.sendall(f"{upgrade}Sec-WebSocket-Accept: {accept_key(key[1].decode())}\r\n\r\n".encode())
            until("a word", lambda: any("still trying" in r.getMessage() for r in caplog.records))
            until("its end", lambda: not any("(keepalive)" in t.name for t in threading.enumerate()))
    told = [r.getMessage() for r in caplog.records if r.levelno >= logging.WARNING]
    assert [text.partition("; ")[0].partition(": ")[2] for text in told] == ["the server no longer answers"]
    assert not any(r.exc_info for r in caplog.records)


def test_what_the_server_says_on_parting_is_told_once(
    bridge: Callable[..., Rosbridge], listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    server = bridge()
    listen(server.source, PROFILE)
    until("a subscription", lambda: server.subscribed == {"/joint_states"})
    server.part(1001, "for lunch")
    until("a word", lambda: "still trying" in caplog.text)
    url = f"ws://127.0.0.1:{server.port}"
    assert (
        f"{url}: the server closed the connection: 1001 (going away) for lunch; still trying" in caplog.text
    )


def test_nonsense_is_told_and_the_rest_goes_on(
    bridge: Callable[..., Rosbridge], listen: Listen, moving: Move, caplog: pytest.LogCaptureFixture
) -> None:
    server = bridge()
    heard = listen(server.source, PROFILE)
    until("a subscription", lambda: server.subscribed == {"/joint_states"})
    wrong = joint_state(1.0, NAMES, [1.0])
    nonsense: list[str | bytes] = [
        '{"op": "png", "data": "iVBORw0KGgo="}',
        "no json",
        b"\xff\xff",
        json.dumps({"op": "publish", "topic": "/joint_states", "msg": wrong}),
        json.dumps({"op": "publish", "topic": "/joint_states", "msg": None}),
        cbor2.dumps({"op": "publish", "topic": "/joint_states", "msg": {"name": cbor2.CBORTag(86, b"123")}}),
        json.dumps({"op": "publish", "topic": "/never_asked_for", "msg": wrong}),
        json.dumps({"op": "service_response", "id": "topics", "values": {"topics": 5, "types": [1]}}),
        json.dumps({"op": "service_response", "id": "publishers /x", "values": {"publishers": None}}),
        json.dumps({"op": "status", "level": "error", "msg": "something about /joint_states"}),
    ]

    def act(t_s: float) -> None:
        for data in nonsense:
            server.say(data)
        server.publish("/joint_states", joint_state(1 + t_s, NAMES, [1.0, 2.0]))

    moving(30, act)
    until("samples all the while", lambda: len(heard.samples) > 20)
    assert heard.newest["pos"] == {"hip": 1.0, "knee": 2.0}
    lines = [r.getMessage() for r in caplog.records]
    assert "rosbridge: PNG compression is not supported, and was not requested" in lines
    assert "/joint_states: position has 1 value, name 2" in lines
    assert "rosbridge says: something about /joint_states" in lines
    assert len(lines) < 12, lines


def test_one_bad_part_of_every_message_is_named_once(
    bridge: Callable[..., Rosbridge], listen: Listen, moving: Move, caplog: pytest.LogCaptureFixture
) -> None:
    server = bridge()
    heard = listen(server.source, PROFILE)

    def act(t_s: float) -> None:
        state = joint_state(1 + t_s, NAMES, [1.0, 2.0]) | {"effort": [round(99 * t_s)] * 3}
        del state["velocity"]
        server.publish("/joint_states", state)

    moving(30, act)
    until("samples", lambda: len(heard.samples) > 20)
    assert heard.newest == {"pos": {"hip": 1.0, "knee": 2.0}}
    assert caplog.messages.count("/joint_states: effort has 3 values, name 2; it is left out") == 1
    assert len([line for line in caplog.messages if "/joint_states" in line]) == 1


def test_without_rosapi_topics_are_asked_for_by_name(
    bridge: Callable[..., Rosbridge], listen: Listen, moving: Move
) -> None:
    server = bridge({"/arm": "", "/target": ""}, rosapi=False)
    heard = listen(server.source, PROFILE + '[ros]\npos = "/arm"\nref = "/target"\n')
    controller = {"joint_names": NAMES, "reference": {"positions": [0.5, 0.6]}}

    def act(t_s: float) -> None:
        state = joint_state(1 + t_s, NAMES, [1.0, 2.0])
        server.publish("/arm", state)
        server.publish("/target", controller | {"header": state["header"]})

    moving(30, act)
    until("both", lambda: set(heard.newest) == {"pos", "ref"})
    assert heard.newest == {"pos": {"hip": 1.0, "knee": 2.0}, "ref": {"hip": 0.5, "knee": 0.6}}
    until(
        "its description is asked for", lambda: "/robot_description" in {w.get("topic") for w in server.asked}
    )


def test_a_topic_that_appears_later(
    bridge: Callable[..., Rosbridge], listen: Listen, moving: Move, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rosbridge_module, "LOOK_S", (0.3, 10.0))
    server = bridge({})
    heard = listen(server.source, PROFILE)
    until("it asks again", lambda: len(server.asked) >= 2)
    server.topics["/joint_states"] = ros_1(JOINT_STATE)
    moving(50, lambda t: server.publish("/joint_states", joint_state(1 + t, NAMES, [1.0, 2.0], ros_1)))
    until("samples", lambda: len(heard.samples) > 5)


def test_a_publisher_that_joins_a_topic_ends_its_throttle(
    bridge: Callable[..., Rosbridge], listen: Listen, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rosbridge_module, "LOOK_S", (0.1, 10.0))
    server = bridge({"/joint_states": ros_2(JOINT_STATE)})
    listen(server.source, PROFILE)

    def throttles() -> list[object]:
        return [w.get("throttle_rate") for w in list(server.asked) if w["op"] == "subscribe"]

    until("one subscription", lambda: throttles() == [rosbridge_module.THROTTLE_MS])
    server.publishers["/joint_states"] = 2
    until("another without a throttle", lambda: throttles() == [rosbridge_module.THROTTLE_MS, None])
    asked = len(server.asked)
    until("it goes on asking", lambda: len(server.asked) > asked + 3)
    assert len(throttles()) == 2


def test_a_server_that_answers_slowly_is_asked_less_often(
    bridge: Callable[..., Rosbridge], listen: Listen, moving: Move, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rosbridge_module, "LOOK_S", (0.01, 10.0))
    monkeypatch.setattr(rosbridge_module, "LOOK_SHARE", 1e-9)  # any time is long
    server = bridge({"/joint_states": ros_2(JOINT_STATE)})
    heard = listen(server.source, PROFILE)
    moving(50, lambda t: server.publish("/joint_states", joint_state(1 + t, NAMES, [1.0, 2.0])))
    until("samples", lambda: len(heard.samples) > 20)
    services = [w["service"] for w in list(server.asked) if w["op"] == "call_service"]
    assert services.count("/rosapi/topics") == 1


def test_diagnostics_are_never_throttled(bridge: Callable[..., Rosbridge], listen: Listen) -> None:
    server = bridge({"/diagnostics": ros_2(DIAGNOSTICS)})
    listen(server.source, PROFILE)
    until("a subscription", lambda: server.subscribed == {"/diagnostics"})
    assert "throttle_rate" not in server.asked[-1]


def test_the_description_of_either_ros(bridge: Callable[..., Rosbridge], listen: Listen) -> None:
    two = bridge({"/robot_description": "std_msgs/msg/String"})
    two.latched["/robot_description"] = {"data": "<robot name='two'/>"}
    one = bridge({"/joint_states": JOINT_STATE})
    one.parameters["/robot_description"] = "<robot name='one'/>"
    of_two, of_one = listen(two.source, None), listen(one.source, None)
    until("the topic", lambda: of_two.urdfs == ["<robot name='two'/>"])
    until("the parameter", lambda: of_one.urdfs == ["<robot name='one'/>"])


def test_of_a_flood_the_newest_arrives(bridge: Callable[..., Rosbridge], listen: Listen) -> None:
    """A server that throttles nothing."""
    server = bridge()
    server.publishers["/joint_states"] = 2
    names = [f"joint{i}" for i in range(40)]
    heard = listen(server.source, None)
    until("a subscription", lambda: server.subscribed == {"/joint_states"})
    stamps = flood(lambda t_s: server.publish("/joint_states", joint_state(t_s, names, [1.0] * 40)), heard)
    until("the newest", lambda: heard.samples[-1].t_s == pytest.approx(stamps[-1], abs=1e-6), 20)
