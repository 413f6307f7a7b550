"""Play back: the recorded states at any moment, in one window, without motion of the arm."""
