"""The motion of a commanded joint position in time. Pure: time is an argument."""
