"""Export of a robot and its motion as VRML97."""
