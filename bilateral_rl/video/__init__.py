"""Videos of trained controllers at work."""
