"""The arm: its description, its control, its drivers and the process that runs it."""
