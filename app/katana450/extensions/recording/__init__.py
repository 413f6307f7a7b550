"""Recordings of a session: exact text forms, MCAP files, simulation again, and their command."""
