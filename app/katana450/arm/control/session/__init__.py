"""The session: from state, commands and time to the next state."""
