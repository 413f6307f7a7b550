"""Commands of the arm, and the acts that they are."""
