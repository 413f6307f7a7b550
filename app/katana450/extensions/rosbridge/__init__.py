"""ROS clients without ROS: the protocol rosbridge v2, and a live connection of Foxglove."""
