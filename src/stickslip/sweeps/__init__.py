"""One system, many values of its parameters: maps of what its motion does."""
