"""ROS robots, over Zenoh (`ros2`) or a rosbridge server (`rosbridge`)."""
