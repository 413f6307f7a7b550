"""Touch of the gripper: pressures on its pads, the sensors of the real gripper, and slip."""
