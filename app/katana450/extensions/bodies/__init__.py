"""The collision worlds of robots outside the five-axis family."""
