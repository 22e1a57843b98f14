"""Run folders, and the trained policies in them."""
