"""The process that records a running arm, and the pipe to it."""
