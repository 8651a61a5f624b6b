"""Source `ros2` against real Zenoh publishers whose keys, tokens and CDR are rmw_zenoh's and the bridge's."""

from __future__ import annotations

import json
import logging
import math
import random
import struct
import time
from collections.abc import Callable

import pytest
import zenoh
from command_stage import run_edge
from edge_stage import ROBOT, Edge, Router
from posecast_edge.sources.ros import ros2 as ros2_module
from posecast_edge.sources.ros.messages import (
    BATTERY,
    CONTROLLER_STATE,
    DIAGNOSTICS,
    IMU,
    JOINT_STATE,
    ODOMETRY,
    PAYLOAD_MAX,
    STRING,
    TF,
    WRENCH,
)
from posecast_edge.sources.ros.ros2 import (
    BRIDGE_TOKENS,
    Found,
    Inbox,
    make_data_key,
    make_token_key,
    match_data_key,
    match_token_key,
)
from posecast_testing import until
from ros_stage import (
    Graph,
    battery,
    controller_state,
    diagnostics,
    imu,
    joint_state,
    odometry,
    text_message,
    transforms,
    wrench,
)
from source_stage import Listen, Listening, Move, Mover, flood

NAMES = ["hip", "knee"]
PROFILE = """
[labels]
joint = ["hip", "knee"]
[[fields]]
name = "pos"
[ros]
base = "/odom"
wrench = { LF = "/ft/left" }
"""
KNEE = """<robot name="leg">
<link name="thigh"/>
<link name="shank"/>
<joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/>
<limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>"""


def joints(graph: Graph, topic: str = "/joint_states") -> Callable[[float], None]:
    """Publishes both joints, with the machine's clock."""
    return lambda t: graph.publish(topic, JOINT_STATE, joint_state(time.monotonic(), NAMES, [1.0, 2.0]))


def test_the_base_by_transforms(graph: Graph, listen: Listen, moving: Move) -> None:
    level = (1.0, 0.0, 0.0, 0.0)
    graph.latch("/tf_static", TF, transforms(1000, ("odom", "rail", (0, 0, 2), level)))  # before the agent

    def act(t_s: float) -> None:
        graph.publish("/joint_states", JOINT_STATE, joint_state(1000 + t_s, NAMES, [t_s, 2.0]))
        graph.publish("/tf", TF, transforms(1000 + t_s, ("rail", "base_link", (t_s, 1, 0), level)))

    heard = listen(graph.source, PROFILE.replace("/odom", "odom→base_link"))
    moving(50, act)
    until("base and joints", lambda: "base" in heard.newest and "pos" in heard.newest)
    base = heard.newest["base"]
    assert (base["base.y"], base["base.z"]) == (1, 2)
    assert heard.newest["baseq"] == {"base.w": 1, "base.x": 0, "base.y": 0, "base.z": 0}
    assert any("frame odom → rail (static)" in line for line in heard.source.offers)


def test_every_type_from_its_own_topic(graph: Graph, listen: Listen, moving: Move) -> None:
    def act(t_s: float) -> None:
        at_s = 1000 + t_s
        state = joint_state(at_s, NAMES, [t_s, 2.0], [0.5, 0.5], [1.0, 2.0])
        graph.publish("/joint_states", JOINT_STATE, state)
        told = controller_state(at_s, NAMES, [0.25, 0.75])
        graph.publish("/legs/controller_state", CONTROLLER_STATE, told)
        graph.publish("/imu/data", IMU, imu(at_s, "pelvis", (0.5, 0.5, 0.5, 0.5), (0.1, 0.2, 0.3)))
        graph.publish("/ft/left", WRENCH, wrench(at_s, "left_foot", (1, 2, 300), (4, 5, 6)))
        graph.publish("/battery_state", BATTERY, battery(at_s, 48.5, -2.5, 0.75))
        graph.publish("/odom", ODOMETRY, odometry(at_s, (1, 2, 0.75), (1, 0, 0, 0)))
        said = diagnostics(at_s, (2, "motor", "hot"), (0, "cpu", "well"))
        graph.publish("/diagnostics", DIAGNOSTICS, said)

    heard = listen(graph.source, PROFILE)
    moving(50, act)
    fields = {"pos", "vel", "effort", "ref", "quat", "gyro", "acc", "ftf", "ftm", "volt", "base", "diag"}
    until("every field", lambda: fields <= set(heard.newest))
    values = heard.newest
    assert values["ref"] == {"hip": 0.25, "knee": 0.75}
    assert values["vel"] == {"hip": 0.5, "knee": 0.5}
    assert values["effort"] == {"hip": 1.0, "knee": 2.0}
    assert values["quat"]["pelvis.w"] == 0.5
    assert values["gyro"] == {"pelvis.x": 0.1, "pelvis.y": 0.2, "pelvis.z": 0.3}
    assert values["ftf"] == {"LF.fx": 1, "LF.fy": 2, "LF.fz": 300}
    assert values["ftm"] == {"LF.mx": 4, "LF.my": 5, "LF.mz": 6}
    assert values["volt"] == {"main": 48.5}
    assert values["charge"] == {"main": 75.0}
    assert values["base"] == {"base.x": 1, "base.y": 2, "base.z": 0.75}
    assert values["diag"] == {"motor": ["error"], "cpu": []}
    assert heard.samples[-1].info == {"motor": "hot", "cpu": "well", "battery": "discharging"}
    assert heard.samples[-1].links == {"pelvis": "pelvis"}
    t_s, values = heard.last
    assert t_s == pytest.approx(1000 + values["pos"]["hip"], abs=1e-6)
    times = [s.t_s for s in heard.samples]
    assert times == sorted(set(times))


def test_two_publishers_of_one_topic(graph: Graph, listen: Listen, moving: Move) -> None:
    def act(joint: str, at: float) -> Callable[[float], None]:
        return lambda t: graph.publish("/joint_states", JOINT_STATE, joint_state(1 + t, [joint], [at]))

    heard = listen(graph.source, PROFILE)
    moving(50, act("hip", 1.0))
    leg = moving(50, act("knee", 2.0))
    until("both", lambda: heard.newest.get("pos") == {"hip": 1.0, "knee": 2.0})
    leg.end()
    until("the dead one's readings are gone", lambda: heard.newest.get("pos") == {"hip": 1.0})


def test_a_robot_described_before_anybody_listened(graph: Graph, listen: Listen) -> None:
    urdf = "<robot name='r'><!--" + "x" * 140_000 + "--><link name='a'/></robot>"
    graph.latch("/robot_description", STRING, text_message(urdf))
    heard = listen(graph.source, None)
    until("the description", lambda: heard.urdfs == [urdf])


def test_a_description_that_comes_later_counts_too(graph: Graph, listen: Listen) -> None:
    heard = listen(graph.source, None)
    until("it runs", lambda: heard.source.offers == [])
    graph.latch("/robot_description", STRING, text_message("<robot name='late'/>"))
    until("the description", lambda: heard.urdfs == ["<robot name='late'/>"])


def test_a_robot_behind_the_dds_bridge(graph: Graph, listen: Listen, moving: Move) -> None:
    put = graph.bridge("/r1/joint_states", JOINT_STATE)
    camera = graph.bridge("/r1/camera", "sensor_msgs/Image")
    heard = listen(f"{graph.source}/r1", PROFILE)

    def act(t_s: float) -> None:
        put(joint_state(1 + t_s, NAMES, [1.0, 2.0]))
        camera(b"\0\1\0\0" + bytes(1000))

    moving(50, act)
    until("positions", lambda: heard.newest.get("pos") == {"hip": 1.0, "knee": 2.0})
    assert [line.split()[:2] for line in heard.source.offers] == [
        ["/r1/camera", "sensor_msgs/Image"],
        ["/r1/joint_states", "sensor_msgs/JointState"],
    ]


def test_only_one_robot_of_several(graph: Graph, listen: Listen, moving: Move) -> None:
    one = listen(f"ros2://127.0.0.1:{graph.port}/r1", PROFILE)
    domain = listen(graph.source, PROFILE + "domain = 7\n")

    def act(t_s: float) -> None:
        graph.publish("/r1/joint_states", JOINT_STATE, joint_state(1 + t_s, NAMES, [1.0, 1.0]))
        graph.publish("/r2/joint_states", JOINT_STATE, joint_state(1 + t_s, NAMES, [2.0, 2.0]))
        graph.publish("/r3/joint_states", JOINT_STATE, joint_state(1 + t_s, NAMES, [3.0, 3.0]), domain=7)

    moving(50, act)
    until("samples of both", lambda: len(one.samples) > 20 and len(domain.samples) > 20)
    assert {s.values["pos"]["hip"] for s in one.samples} == {1.0}  # type: ignore[call-overload]
    assert {s.values["pos"]["hip"] for s in domain.samples} == {3.0}  # type: ignore[call-overload]


def test_bad_payloads_are_told_and_the_good_ones_go_on(
    graph: Graph, listen: Listen, moving: Move, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "posecast_edge")
    good = joint_state(1.0, NAMES, [1.0, 2.0], [0.1, 0.2])
    chance = random.Random(7)
    bad = [good[:n] for n in range(len(good))] + [
        bytes(chance.randrange(256) if chance.random() < 0.05 else b for b in good) for _ in range(200)
    ]
    bad += [b"\0\1\0\0" + struct.pack("<I", 0xFFFFFFFF) * 9, good + bytes(9), b"\xff" * 4000]
    heard = listen(graph.source, PROFILE)
    left = list(bad)

    def act(t_s: float) -> None:
        for _ in range(min(2, len(left))):
            graph.publish("/other/joint_states", JOINT_STATE, left.pop())
        graph.publish("/camera", "sensor_msgs/Image", b"\0\1\0\0" + bytes(500_000))
        graph.publish("/camera", "sensor_msgs/Image", b"\0\1\0\0")
        graph.publish("/big/joint_states", JOINT_STATE, bytes(PAYLOAD_MAX + 1))
        graph.publish("/joint_states", JOINT_STATE, joint_state(1 + t_s, NAMES, [1.0, 2.0]))

    moving(100, act)
    until("all the bad ones", lambda: not left, 30)
    n = len(heard.samples)
    until("good ones after them", lambda: len(heard.samples) > n + 5, 30)
    assert {"hip": 1.0, "knee": 2.0}.items() <= heard.newest["pos"].items()
    lines = [r.getMessage() for r in caplog.records]
    told = [
        line for line in lines if "joint_states: " in line and "that are not a sensor_msgs/JointState" in line
    ]
    assert 1 <= len(told) <= 4, told  # the first at once, then counts
    assert (
        len(
            [
                line
                for line in lines
                if "/camera is ignored: the type sensor_msgs/Image is not supported" in line
            ]
        )
        == 1
    )


def test_of_a_flood_the_newest_arrives(graph: Graph, listen: Listen) -> None:
    """What can't be read in time is dropped, and it is the oldest."""
    names = [f"joint{i}" for i in range(40)]
    heard = listen(graph.source, None)
    stamps = flood(
        lambda t_s: graph.publish("/joint_states", JOINT_STATE, joint_state(t_s, names, [1.0] * 40)), heard
    )
    until("the newest", lambda: heard.samples[-1].t_s == pytest.approx(stamps[-1], abs=1e-6))
    assert len(heard.samples) < len(stamps)


def test_a_full_inbox_drops_the_oldest() -> None:
    inbox = Inbox()
    size = ros2_module.BACKLOG_MAX // 4 - ros2_module.WAITING
    for k in range(10):
        inbox.put("/a", JOINT_STATE, bytes([k]) * size)
    taken, lost = inbox.take(0.0)
    assert [payload[0] for _, _, payload in taken] == [6, 7, 8, 9]
    assert lost == 6
    assert inbox.take(0.0) == ([], 0)


def test_a_robot_that_goes_and_comes_back(
    graph: Graph, listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "posecast_edge")
    heard = listen(graph.source, PROFILE)
    began_s = time.monotonic()

    first = Mover(50, joints(graph))
    until("samples", lambda: len(heard.samples) > 10)
    first.end()
    graph.stop()
    until("the loss is said", lambda: any("router lost" in r.getMessage() for r in caplog.records))
    graph.start()
    n = len(heard.samples)
    again = Mover(50, joints(graph))
    until("samples again", lambda: len(heard.samples) > n + 10, 20)
    again.end()
    assert heard.samples[-1].t_s > began_s


def test_a_robot_that_is_not_there_yet(caplog: pytest.LogCaptureFixture) -> None:
    graph = Graph()
    heard = Listening(graph.source, PROFILE)
    until("a word", lambda: any("does not answer; still trying" in r.getMessage() for r in caplog.records))
    graph.start()
    mover = Mover(50, joints(graph))
    until("samples", lambda: len(heard.samples) > 5, 20)
    mover.end()
    heard.end()
    graph.stop()


def test_stamps_that_stand_still_are_silence(
    graph: Graph, listen: Listen, moving: Move, caplog: pytest.LogCaptureFixture
) -> None:
    heard = listen(graph.source, PROFILE)
    moving(50, lambda t: graph.publish("/joint_states", JOINT_STATE, joint_state(5.0, NAMES, [t, 2.0])))
    until("a word", lambda: any("stamps do not change" in r.getMessage() for r in caplog.records))
    assert len(heard.samples) == 1


def test_without_a_profile_the_first_sample_has_every_topic(
    graph: Graph, listen: Listen, moving: Move
) -> None:
    heard = listen(graph.source, None)
    moving(50, joints(graph))
    moving(2, lambda t: graph.publish("/battery_state", BATTERY, battery(1 + t, 48.0, 1.0, math.nan)))
    until("the first sample", lambda: heard.samples != [])
    assert {"pos", "volt", "amp", "charge"} <= set(heard.samples[0].values)


def test_the_source_s_session_subscribes_and_the_uplink_s_does_not(
    graph: Graph, router: Router, moving: Move
) -> None:
    """Two sessions in one process: what is declared to either router, as the routers themselves tell it."""
    graph.latch("/robot_description", STRING, text_message("<robot name='r'><link name='a'/></robot>"))
    moving(50, joints(graph))
    flags = ("--robot", ROBOT, "--source", graph.source, "--relay", router.endpoint)
    edge = Edge("run", *flags, stdin=False)
    try:
        until("frames at the relay", lambda: len(router.frames) >= 5, 20)
        assert router.session is not None
        assert graph.router is not None
        assert graph.nodes is not None
        strangers = declared_to(router.session, {str(router.session.zid())})
        assert strangers["subscriber"] == set()
        assert strangers["queryable"] != set()  # a router does tell
        assert strangers["publisher"] != set()
        ours = {str(graph.router.zid()), str(graph.nodes.zid())}
        at_the_robot = declared_to(graph.router, ours)
        assert any(
            key.endswith("**/sensor_msgs::msg::dds_::JointState_/*") for key in at_the_robot["subscriber"]
        )
        assert at_the_robot["publisher"] == set()
        assert at_the_robot["queryable"] == set()
    finally:
        edge.kill()


def declared_to(router: zenoh.Session, own: set[str]) -> dict[str, set[str]]:
    """What sessions other than `own` have declared to a router: kind → keys."""
    found: dict[str, set[str]] = {}
    for kind in ("subscriber", "queryable", "publisher"):
        found[kind] = set()
        for reply in router.get(f"@/*/router/{kind}/**", timeout=3.0):
            assert reply.ok is not None
            by = json.loads(reply.ok.payload.to_string())
            if not {zid for zids in by.values() for zid in zids} <= own:
                found[kind].add(str(reply.ok.key_expr).partition(f"/{kind}/")[2])
    return found


def test_probe_lists_the_topics_and_doctor_holds_them_against_the_description(
    graph: Graph, moving: Move
) -> None:
    graph.latch("/robot_description", STRING, text_message(KNEE))
    graph.declare("/camera", "sensor_msgs/Image")
    moving(50, joints(graph))
    probed = run_edge("probe", graph.source, "--seconds", "0.5")
    assert probed.returncode == 0, probed.stderr
    *_, camera, positions, description = probed.stdout.splitlines()
    assert camera.split() == ["/camera", "sensor_msgs/Image", "not", "read"]
    assert positions.split()[:4] == ["/joint_states", "sensor_msgs/JointState", "→", "pos"]
    assert description.split()[3:] == ["description", "1", "message"]
    examined = run_edge("doctor", "--source", graph.source, "--seconds", "0.5")
    assert examined.returncode == 1
    assert (
        f"{graph.source}: warning: channel 'hip' moves nothing: the model has no such joint"
        in examined.stdout
    )
    assert (
        "robot_description:4: warning: joint 'knee' moves from 2 to 2 rad; its limits are" in examined.stdout
    )


# --- keys and tokens of rmw_zenoh and zenoh-bridge-ros2dds

HASH = "RIHS01_" + "ab" * 32
DDS = "sensor_msgs::msg::dds_::JointState_"
TOKEN = f"@ros2_lv/0/aac3178e/0/12/MP/%/%r1/talker/%r1%joint_states/{DDS}/{HASH}/::,10:,:,:,,"
BRIDGE = "@/b2f1/@ros2_lv/MP/r1§joint_states/sensor_msgs§msg§JointState/:::,10"


@pytest.mark.parametrize("of_type", [HASH, "TypeHashNotSupported"])
def test_data(of_type: str) -> None:
    assert match_data_key(f"0/r1/arm/joint_states/{DDS}/{of_type}") == Found(
        "/r1/arm/joint_states", JOINT_STATE
    )
    assert match_data_key(f"42/joint_states/{DDS}/{of_type}") == Found("/joint_states", JOINT_STATE)


@pytest.mark.parametrize("key", ["", "joint_states", "a/b/c/d", f"x/joint_states/{DDS}/{HASH}", "0/a/b/c"])
def test_what_is_no_data(key: str) -> None:
    assert match_data_key(key) is None


def test_tokens() -> None:
    assert match_token_key(TOKEN) == Found("/r1/joint_states", JOINT_STATE)
    assert match_token_key(BRIDGE) == Found("/r1/joint_states", JOINT_STATE, "r1/joint_states")


@pytest.mark.parametrize(
    "key",
    [
        TOKEN.replace("/MP/", "/MS/"),
        TOKEN.replace("/::,", "/x/::,"),
        BRIDGE.replace("/MP/", "/MS/"),
        "@ros2_lv",
        "@/a/b",
        "",
    ],
)
def test_what_is_no_publisher(key: str) -> None:
    assert match_token_key(key) is None


def test_patterns_meet_the_keys_they_are_for() -> None:
    def meets(pattern: str, key: str) -> bool:
        return zenoh.KeyExpr(pattern).intersects(zenoh.KeyExpr(key))

    data = f"0/r1/joint_states/{DDS}/{HASH}"
    for pattern in ("/**", "/r1/**", "/r1/joint_states", "/*/joint_states", "/r*/joint_*"):
        assert meets(make_data_key(pattern, JOINT_STATE, None), data), pattern
    for pattern in ("/r2/**", "/joint_states", "/*"):
        assert not meets(make_data_key(pattern, JOINT_STATE, None), data), pattern
    assert meets(make_data_key("/**", JOINT_STATE, 0), data)
    assert not meets(make_data_key("/**", JOINT_STATE, 1), data)
    assert not meets(make_data_key("/**", "sensor_msgs/Imu", None), data)
    assert meets(make_token_key(None), TOKEN)
    assert not meets(make_token_key(3), TOKEN)
    assert meets(BRIDGE_TOKENS, BRIDGE)
