"""Scene files: one module per format, one line in the table."""
