"""A training from its start or resume to its end."""
