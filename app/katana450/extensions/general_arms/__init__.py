"""Inverse kinematics of arms beyond the five-axis family: closed forms, and a fallback."""
