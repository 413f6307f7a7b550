"""What the arm is told, and what it makes of it. Pure: no I/O, no clock, no thread, no log."""
