"""Rules of the arm: commands, states and the step between them.

Pure: no I/O, no clock, no thread, no log.
"""
