"""Experiments as data: what a YAML file says of trials, checked, drawn and read."""
