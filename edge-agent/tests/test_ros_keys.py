"""Keys and tokens of rmw_zenoh and zenoh-bridge-ros2dds."""

from __future__ import annotations

import pytest
import zenoh
from posecast_edge.sources.ros.messages import JOINT_STATE
from posecast_edge.sources.ros.ros2 import (
    BRIDGE_TOKENS,
    Found,
    make_data_key,
    make_token_key,
    match_data_key,
    match_token_key,
)

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
