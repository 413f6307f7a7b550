"""Execution of the requests of pages and programs, and the rules of the lease."""
