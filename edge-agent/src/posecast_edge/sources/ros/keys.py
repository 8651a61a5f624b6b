"""ROS 2 names in Zenoh's keys, as rmw_zenoh and zenoh-bridge-ros2dds write them. Pure.

rmw_zenoh  data   DOMAIN/TOPIC/TYPE/HASH                TYPE: sensor_msgs::msg::dds_::JointState_
           token  @ros2_lv/DOMAIN/ZID/NODE/ID/MP/ENCLAVE/NAMESPACE/NODE NAME/TOPIC/TYPE/HASH/QOS, % for /
bridge     data   TOPIC                                 no type: the token has it
           token  @/ZID/@ros2_lv/MP/TOPIC/TYPE/QOS, § for /; TYPE: sensor_msgs/msg/JointState
"""

from __future__ import annotations

from dataclasses import dataclass

from posecast_edge.sources.ros.messages import shorten_type

ANY_DOMAIN = "*"
BRIDGE_TOKENS = "@/*/@ros2_lv/MP/**"


@dataclass(frozen=True)
class Found:
    """A topic with a publisher. `type_name`: short form. `key`: where a bridge publishes its data; None for
    rmw_zenoh, whose key follows from topic and type."""

    topic: str
    type_name: str
    key: str | None = None


def make_dds_type(type_name: str) -> str:
    """Convert `sensor_msgs/JointState` to `sensor_msgs::msg::dds_::JointState_`."""
    package, _, name = type_name.partition("/")
    return f"{package}::msg::dds_::{name}_"


def make_data_key(pattern: str, type_name: str, domain: int | None) -> str:
    """The key expression of rmw_zenoh's data for all topics that match `pattern` (see topics.match_topic)."""
    parts = [p if p in ("*", "**") else p.replace("*", "$*") for p in pattern.strip("/").split("/")]
    where = ANY_DOMAIN if domain is None else domain
    return f"{where}/{'/'.join(parts)}/{make_dds_type(type_name)}/*"


def make_token_key(domain: int | None) -> str:
    """The key expression of the liveliness tokens of rmw_zenoh's publishers."""
    return f"@ros2_lv/{ANY_DOMAIN if domain is None else domain}/*/*/*/MP/**"


def match_data_key(key: str) -> Found | None:
    """The topic and type in a data key of rmw_zenoh; None for any other key."""
    parts = key.split("/")
    if len(parts) < 4 or not parts[0].isdigit() or "::" not in parts[-2]:
        return None
    return Found("/" + "/".join(parts[1:-2]), shorten_type(parts[-2]))


def match_token_key(key: str) -> Found | None:
    """The topic and type in a publisher's liveliness token; None for any other key."""
    parts = key.split("/")
    if parts[0] == "@ros2_lv" and len(parts) == 13 and parts[5] == "MP":
        return Found(_slashes(parts[9], "%"), shorten_type(parts[10]))
    if parts[0] == "@" and len(parts) == 7 and parts[2:4] == ["@ros2_lv", "MP"]:
        topic = _slashes(parts[4], "§")
        return Found(topic, shorten_type(parts[5].replace("§", "/")), topic.lstrip("/"))
    return None


def _slashes(name: str, stand_in: str) -> str:
    return "/" + name.replace(stand_in, "/").lstrip("/")
