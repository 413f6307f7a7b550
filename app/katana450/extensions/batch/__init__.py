"""Inverse kinematics of many poses at once, for the library and other extensions."""
