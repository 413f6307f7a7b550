"""Compilation of scripts to programs, their execution and simulation."""
