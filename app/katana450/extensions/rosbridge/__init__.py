"""ROS clients without ROS: the protocol rosbridge v2."""
