"""Studies: many independent jobs, run by local processes or on a Ray cluster, with one board for all."""
