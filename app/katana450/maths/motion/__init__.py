"""How a commanded joint position moves in time. Pure: time comes in as an argument."""
