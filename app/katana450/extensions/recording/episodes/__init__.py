"""Episodes: marked parts of a recording with a task and an outcome, each kept in its own file."""
