"""Robot descriptions in xacro, the macro language of ROS."""
