"""Paths of exact shape, their timing under limits, and paths around obstacles. Pure."""
