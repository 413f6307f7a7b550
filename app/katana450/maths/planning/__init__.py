"""Paths whose shape is exact, their time under limits, and ways round what is in between. Pure."""
