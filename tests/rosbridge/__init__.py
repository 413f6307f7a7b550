"""Tests of ROS clients on a server; a package, so that their server can have its scope."""
