"""Forward and inverse kinematics of the arm, and the nearest solution for arbitrary poses."""
