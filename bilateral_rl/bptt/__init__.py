"""Supervised training by back-propagation through time: many networks at once, each as if alone."""
