"""Scripts, their compilation to programs, and the execution of programs. Pure: no I/O.

A folder imports only those after it: server, run, script, steps, building, planning, language.
"""
