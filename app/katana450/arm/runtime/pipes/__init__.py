"""Pipes between the process of the arm and the others, with their two ends."""
