"""What trained networks do, measured, lesioned and compared."""
