"""The choice of the robot on the page, while the server runs."""
