"""The study of two arms that one brain controls: its readings, its tables of results, and what its report shows."""
