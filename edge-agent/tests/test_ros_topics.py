"""Which topics are read as what: by name and type, and by the profile's [ros]."""

from __future__ import annotations

import pytest
from posecast_edge.profile.reader import ROLES, ProfileError, parse_profile
from posecast_edge.profile.types import RosTopics
from posecast_edge.sources.ros.messages import (
    BATTERY,
    CONTROLLER_STATE,
    DIAGNOSTICS,
    IMU,
    JOINT_STATE,
    ODOMETRY,
    STRING,
    TF,
    WRENCH,
)
from posecast_edge.sources.ros.topics import TYPES_OF_ROLE, Route, Routes, match_topic

FIELDS = '[[fields]]\nname = "pos"\nlabels = ["a"]\n'


@pytest.mark.parametrize(
    ("topic", "type_name", "route"),
    [
        ("/joint_states", JOINT_STATE, Route("pos")),
        ("/robot/limb/left/joint_states", JOINT_STATE, Route("pos")),
        ("/joint_commands", JOINT_STATE, Route("ref")),
        ("/arm/joint_command", JOINT_STATE, Route("ref")),
        ("/desired", JOINT_STATE, Route("ref")),
        ("/joint_states_raw", JOINT_STATE, None),
        ("/arm_controller/controller_state", CONTROLLER_STATE, Route("ref")),
        ("/imu/data", IMU, Route("imu")),
        ("/ft/left", WRENCH, Route("wrench")),
        ("/battery_state", BATTERY, Route("battery", "main")),
        ("/left/battery", BATTERY, Route("battery", "left")),
        ("/diagnostics", DIAGNOSTICS, Route("diagnostics")),
        ("/diagnostics_agg", DIAGNOSTICS, None),
        ("/odom", ODOMETRY, None),
        ("/robot_description", STRING, Route("description")),
        ("/chatter", STRING, None),
        ("/camera", "sensor_msgs/Image", None),
    ],
)
def test_by_name_and_type(topic: str, type_name: str, route: Route | None) -> None:
    assert Routes(None).find_route(topic, type_name) == route


def test_only_below_a_namespace() -> None:
    routes = Routes(None, "/r1")
    assert routes.find_route("/r1/joint_states", JOINT_STATE) == Route("pos")
    assert routes.find_route("/r2/joint_states", JOINT_STATE) is None
    assert routes.find_route("/r10/joint_states", JOINT_STATE) is None
    assert routes.find_route("/r1/battery", BATTERY) == Route("battery", "main")


def routes_of(ros: str, namespace: str = "") -> Routes:
    return Routes(parse_profile(f"{FIELDS}[ros]\n{ros}").ros, namespace)


def test_a_profile_names_topics_and_sites() -> None:
    routes = routes_of(
        'pos = ["/a/state", "/hands/*/state"]\nref = "/target"\nimu = { torso = "/imu" }\n'
        'wrench = []\nbase = "/odom"'
    )
    assert routes.find_route("/a/state", JOINT_STATE) == Route("pos")
    assert routes.find_route("/hands/left/state", JOINT_STATE) == Route("pos")
    assert routes.find_route("/joint_states", JOINT_STATE) is None  # what is named excludes the usual
    assert routes.find_route("/target", JOINT_STATE) == Route("ref")
    assert routes.find_route("/target", CONTROLLER_STATE) == Route("ref")
    assert routes.find_route("/imu", IMU) == Route("imu", "torso")
    assert routes.find_route("/other", IMU) is None
    assert routes.find_route("/ft", WRENCH) is None
    assert routes.find_route("/odom", ODOMETRY) == Route("base")
    assert routes.find_route("/battery", BATTERY) == Route("battery", "main")


def test_transforms_are_read_where_a_profile_names_two_frames_or_probe_asks() -> None:
    routes = Routes(None)
    assert routes.find_route("/tf", TF) is None
    assert not [pattern for pattern, name in routes.list_patterns() if name == TF]
    routes.watch_frames()
    assert routes.find_route("/tf", TF) == Route("tf")
    for arrow in ("odom→base_link", "/odom -> /base_link"):
        routes = routes_of(f'base = "{arrow}"', "r1")
        assert routes.base_frames == ("odom", "base_link")
        assert routes.find_route("/odom", ODOMETRY) is None
        assert routes.find_route("/tf", TF) == routes.find_route("/r1/tf", TF) == Route("tf")
        assert routes.find_route("/tf_static", TF) == Route("tf", "static")
        assert routes.find_route("/r2/tf", TF) is None
    patterns = [pattern for pattern, name in routes.list_patterns() if name == TF]
    assert patterns == ["/r1/**/tf", "/tf", "/r1/**/tf_static", "/tf_static"]
    named = dict(routes.list_topics())
    assert (named["/tf"], named["/tf_static"]) == (Route("tf"), Route("tf", "static"))


def test_what_a_profile_names_may_lie_outside_the_namespace() -> None:
    routes = routes_of('diagnostics = "/diagnostics"', "r1")
    assert routes.find_route("/diagnostics", DIAGNOSTICS) == Route("diagnostics")


@pytest.mark.parametrize(
    ("pattern", "topic", "fits"),
    [
        ("/a", "/a", True),
        ("/a", "/a/b", False),
        ("/a/*", "/a/b", True),
        ("/a/*", "/a", False),
        ("/a/*", "/a/b/c", False),
        ("/a_*/s", "/a_b/s", True),
        ("/**/s", "/s", True),
        ("/**/s", "/a/b/s", True),
        ("/a/**", "/a", True),
        ("/a/**", "/a/b/c", True),
        ("/a/**", "/ab", False),
        ("/a.c", "/abc", False),
    ],
)
def test_patterns(pattern: str, topic: str, fits: bool) -> None:
    assert match_topic(pattern, topic) is fits


def test_what_is_asked_for_holds_every_topic_once() -> None:
    wanted = Routes(None).list_patterns()
    assert ("/**", JOINT_STATE) in wanted
    assert ("/**/robot_description", STRING) in wanted
    assert [t for _, t in wanted if t == ODOMETRY] == []
    assert len({t for _, t in wanted}) == len(wanted)
    narrow = routes_of('pos = "/a"\nref = ["/b", "/c/*"]').list_patterns()
    assert [p for p, t in narrow if t == JOINT_STATE] == ["/a", "/b", "/c/*"]
    half = routes_of('pos = "/a"').list_patterns()
    assert [p for p, t in half if t == JOINT_STATE] == ["/**"]


def test_topics_to_ask_for_by_name() -> None:
    assert Routes(None, "/r1").list_topics() == [
        ("/r1/joint_states", Route("pos")),
        ("/r1/robot_description", Route("description")),
    ]
    named = routes_of('pos = ["/a", "/b/*"]\nimu = { torso = "/imu" }').list_topics()
    assert named == [
        ("/a", Route("pos")),
        ("/imu", Route("imu", "torso")),
        ("/robot_description", Route("description")),
    ]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('poss = "/a"', "profile:5: ros.poss: unknown key"),
        ('base = "odom→"', "profile:5: ros.base: 'odom→' is not a pair of frames such as odom→base_link"),
        ('base = "a->b->c"', "profile:5: ros.base: 'a->b->c' is not a pair of frames"),
        ('pos = "a b"', "profile:5: ros.pos: 'a b' is not a topic"),
        ("pos = 5", "profile:5: ros.pos: must be a text"),
        ('pos = { x = "/a" }', "profile:5: ros.pos: must be a text"),
        ('imu = { "a.b" = "/a" }', "ros.imu.a.b: a site must be one word"),
        ("domain = 300", "profile:5: ros.domain: must be an integer from 0 to 232"),
        ('encoding = "png"', "profile:5: ros.encoding: unknown encoding 'png'"),
    ],
)
def test_a_wrong_table_names_its_line(line: str, words: str) -> None:
    with pytest.raises(ProfileError) as e:
        parse_profile(f"{FIELDS}[ros]\n{line}\n")
    assert words in str(e.value)


def test_every_role_a_profile_may_name_has_types_that_serve_it() -> None:
    assert set(TYPES_OF_ROLE) == {*ROLES, "tf"}


STATES, IMAGES = "sensor_msgs/JointState", "sensor_msgs/Image"


@pytest.mark.parametrize(
    ("topics", "named"),
    [
        ({"/xarm/joint_state_measured": STATES}, "/xarm/joint_state_measured"),
        ({"/measured_js": STATES, "/other_js": STATES}, "/measured_js"),
        ({"/joints": STATES, "/image": IMAGES}, "/joints"),
        ({"/image": IMAGES, "/arm/state": STATES, "/imu": "sensor_msgs/Imu"}, "/arm/state"),
        ({"/joint_commands": STATES, "/measured_js": STATES}, "/measured_js"),
        ({"/desired": STATES, "/joint_commands": STATES}, ""),
        ({"/joint_states": STATES, "/measured_js": STATES}, ""),
        ({"/a/joint_state": STATES, "/measured_js": STATES}, ""),
        ({"/image": IMAGES}, ""),
        ({}, ""),
    ],
)
@pytest.mark.parametrize("given", ["none", "pos", "imu"])
def test_joint_states_under_another_name_are_named(topics: dict[str, str], named: str, given: str) -> None:
    """Unless a profile says what positions are."""
    chosen = {"none": None, "pos": RosTopics({"pos": ()}), "imu": RosTopics({"imu": (("/imu", "a"),)})}[given]
    text = Routes(chosen).explain_unread(topics)
    if not named or given == "pos":
        assert text == ""
    else:
        assert text == (
            f"no topic is called joint_states, but {named} has joint states; "
            f'to read it, in a profile: [ros] pos = ["{named}"]'
        )
