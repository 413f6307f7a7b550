"""Undo of the last changes of the driver."""
