"""Rigid-body geometry: rotations, poses, twists and screws. Twist order is (omega, v)."""
