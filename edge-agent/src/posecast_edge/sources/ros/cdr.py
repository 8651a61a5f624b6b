"""Decodes serialised messages of ROS 2 (CDR) and ROS 1, with rosbags (the extras [ros] and [mcap])."""

from __future__ import annotations

import logging
from collections.abc import Callable

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from posecast_edge.sources.ros.messages import (
    CONTROLLER_STATE,
    DESCRIPTION_MAX,
    PAYLOAD_MAX,
    STRING,
    TF,
    RosMessageError,
)

# The definition starts like this in every ROS 2; the rest differs. The controller's target comes first.
CONTROLLER_HEAD = """
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint reference
"""
TRANSFORMS = "geometry_msgs/TransformStamped[] transforms"  # tf2_msgs, which rosbags has for ROS 2 only
HEAD = "posecast/msg/ControllerHead"
log = logging.getLogger("posecast_edge.ros")

ENCAPSULATION = 4  # bytes before the message
LITTLE_OR_BIG = (b"\0\1", b"\0\0")


class CdrReader:
    """Decodes ROS 2 messages of the types in messages.py. Not thread-safe."""

    def __init__(self) -> None:
        self._store = get_typestore(Stores.ROS2_HUMBLE)  # the types read here are the same in every ROS 2
        self._store.register(get_types_from_msg(CONTROLLER_HEAD, HEAD))

    def read(self, type_name: str, payload: bytes) -> object:
        """Decode a payload into an object with the message's members as attributes. `type_name`: short form.
        Raises RosMessageError."""
        return _decoded(type_name, payload, self._decode)

    def _decode(self, type_name: str, payload: bytes) -> object:
        if type_name != CONTROLLER_STATE:
            return self._store.deserialize_cdr(payload, _long(type_name))
        # only this part of a controller's state is read; the rest may have any layout
        if payload[:2] not in LITTLE_OR_BIG or len(payload) < ENCAPSULATION:
            raise RosMessageError("not CDR")
        definition = self._store.get_msgdef(HEAD)
        read = definition.deserialize_cdr_le if payload[1] else definition.deserialize_cdr_be
        return read(payload[ENCAPSULATION:], 0, definition.cls, self._store)[0]


class Ros1Reader:
    """Decodes ROS 1 messages of the types in messages.py. Not thread-safe."""

    def __init__(self) -> None:
        self._store = get_typestore(Stores.ROS1_NOETIC)
        self._store.register(get_types_from_msg(CONTROLLER_HEAD, HEAD))
        self._store.register(get_types_from_msg(TRANSFORMS, _long(TF)))

    def read(self, type_name: str, payload: bytes) -> object:
        """Decode a message into an object with its members as attributes. `type_name`: short form. Raises
        RosMessageError."""
        return _decoded(type_name, payload, self._decode)

    def _decode(self, type_name: str, payload: bytes) -> object:
        if type_name != CONTROLLER_STATE:
            return self._store.deserialize_ros1(payload, _long(type_name))
        definition = self._store.get_msgdef(HEAD)
        return definition.deserialize_ros1(payload, 0, definition.cls, self._store)[0]


def _decoded(type_name: str, payload: bytes, decode: Callable[[str, bytes], object]) -> object:
    most = DESCRIPTION_MAX if type_name == STRING else PAYLOAD_MAX
    if len(payload) > most:
        raise RosMessageError(f"a message of {len(payload)} bytes is too large")
    try:
        return decode(type_name, payload)
    except RosMessageError:
        raise
    except Exception as e:  # generated code: its exceptions are undocumented
        log.debug("%s", type_name, exc_info=e)
        raise RosMessageError(f"{len(payload)} bytes that are not a {type_name}, or cut off") from None


def _long(type_name: str) -> str:
    package, _, name = type_name.partition("/")
    return f"{package}/msg/{name}"
