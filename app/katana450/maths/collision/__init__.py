"""Clearance of the arm from itself and its environment, and how far it may move. Pure."""
