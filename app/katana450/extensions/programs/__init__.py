"""Scripts, their compilation to programs, and the execution of programs. Pure: no I/O."""
