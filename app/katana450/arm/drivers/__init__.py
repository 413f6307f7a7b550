"""What stands between a setpoint and an arm. Every driver is a ``Driver``; one is simulated."""
