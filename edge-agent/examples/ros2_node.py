"""A ROS 2 node on a URL: python3 ros2_node.py [RELAY]    (source /opt/ros/…/setup.bash first)

For a robot whose node you write yourself. Where you only want to watch, `posecast-edge run --source ros2`
needs neither a node nor ROS beside it.
"""

import sys
from typing import Any

import posecast


def publish_joint_state(robot: posecast.Robot, message: Any) -> None:
    """`message`: a sensor_msgs/JointState. What its sender leaves empty it does not know."""
    stamp = message.header.stamp

    def by_name(numbers: Any) -> dict[str, float] | None:
        return dict(zip(message.name, numbers, strict=True)) if len(numbers) == len(message.name) else None

    robot.publish(
        t=stamp.sec + stamp.nanosec / 1e9,
        pos=by_name(message.position),
        vel=by_name(message.velocity),
        effort=by_name(message.effort),
    )


def main(relay: str = "tcp/127.0.0.1:7447") -> None:
    import rclpy  # noqa: PLC0415 - so that the function above can be tried without ROS
    from rclpy.qos import qos_profile_sensor_data  # noqa: PLC0415
    from sensor_msgs.msg import JointState  # noqa: PLC0415

    rclpy.init()
    node = rclpy.create_node("posecast")
    with posecast.Robot("ros2-arm", relay=relay) as robot:
        node.create_subscription(
            JointState,
            "/joint_states",
            lambda message: publish_joint_state(robot, message),
            qos_profile_sensor_data,
        )
        rclpy.spin(node)


if __name__ == "__main__":
    main(*sys.argv[1:])
