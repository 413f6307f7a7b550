"""The connection to viser: every use of its private parts is in this package."""
