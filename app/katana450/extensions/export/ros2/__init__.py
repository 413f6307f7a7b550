"""Files of the exported ROS 2 package beside the URDF and its meshes."""
