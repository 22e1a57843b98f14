"""Files, terminals and errors: what the toolkit reads and writes, whole or not at all."""
