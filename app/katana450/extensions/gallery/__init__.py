"""Robots by name, from the descriptions that the package robot_descriptions downloads."""
