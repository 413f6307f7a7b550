"""Scenes: what stands around the arm, as a text that people read and write."""
