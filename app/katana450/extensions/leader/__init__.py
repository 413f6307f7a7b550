"""A leader arm of Feetech servos that a person moves by hand, and that the arm follows."""
