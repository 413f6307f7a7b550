"""Export of the robot, its motions and runs to files for other programs."""
