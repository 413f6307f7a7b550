"""Files for other programs, out and in."""
