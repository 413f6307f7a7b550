"""Readers of shape and scene files of other programs."""
