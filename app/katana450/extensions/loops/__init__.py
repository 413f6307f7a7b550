"""Closed loops of joints in robot descriptions."""
