"""Commands that run scripts and demos: on a server, or simulated with a report."""
