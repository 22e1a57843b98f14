"""A training's configuration: typed fields with their bounds, tuned defaults, the catalogue of models."""
