"""Connections to an arm: TCP and serial, with a deadline for each exchange."""
