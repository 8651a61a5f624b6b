"""Posecast for Python programs: put a robot on a URL.

import posecast

with posecast.Robot("my-arm", urdf="arm.urdf", relay="tcp/127.0.0.1:7447") as robot:
    robot.publish(pos={"elbow": 0.4})
"""

from posecast_edge.robot import Robot, RobotStatus

__all__ = ["Robot", "RobotStatus"]
