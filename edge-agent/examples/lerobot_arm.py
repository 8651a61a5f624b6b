"""A LeRobot arm on a URL: python lerobot_arm.py PORT [RELAY]    (pip install lerobot)

LeRobot names its readings `shoulder_pan.pos`, in degrees (`use_degrees`, the default of SO-100 and SO-101);
a gripper is 0 to 100 percent open, which is no angle and becomes a table of its own.
"""

import math
import sys
import time
from collections.abc import Mapping
from typing import Any

import posecast

PERCENT = {"gripper"}


def publish_lerobot(robot: posecast.Robot, observation: Mapping[str, Any], action: Mapping[str, Any]) -> None:
    """`observation`: of get_observation(), pictures and all; `action`: what send_action() was given."""
    robot.publish(
        pos=read_joints(observation),
        ref=read_joints(action),
        opening={name: observation[f"{name}.pos"] for name in PERCENT if f"{name}.pos" in observation},
    )


def read_joints(readings: Mapping[str, Any]) -> dict[str, float]:
    """Joint → rad."""
    motors = {key.removesuffix(".pos"): value for key, value in readings.items() if key.endswith(".pos")}
    return {name: math.radians(value) for name, value in motors.items() if name not in PERCENT}


def main(port: str, relay: str = "tcp/127.0.0.1:7447") -> None:
    from lerobot.robots.so_follower import SO101Follower, SO101FollowerConfig  # noqa: PLC0415 - needs an arm

    arm = SO101Follower(SO101FollowerConfig(port=port, id="so101"))
    arm.connect()
    with posecast.Robot("so101", relay=relay) as robot:
        while True:
            observation = arm.get_observation()
            action = observation  # what your policy or teleoperator says
            publish_lerobot(robot, observation, arm.send_action(action))
            time.sleep(1 / 30)


if __name__ == "__main__":
    main(*sys.argv[1:])
