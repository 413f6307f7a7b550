"""The command that says who may use a server."""
