"""Forward and inverse kinematics of the arm, and what it can do with an arbitrary pose."""
