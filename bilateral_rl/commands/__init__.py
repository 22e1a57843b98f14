"""The commands: each file parses, calls and prints for one of them."""
