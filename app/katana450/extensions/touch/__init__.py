"""Touch of the gripper: pressures on its pads, and slip."""
