"""The driver of an arm: a state machine without input or output, and the thread that runs it."""
