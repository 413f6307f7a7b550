"""Scripts and demos run from the command line: on a server, or simulated with a report."""
