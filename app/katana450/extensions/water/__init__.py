"""The water of the state, drawn in the scene."""
