"""Motion files: JSON, JSON Lines, Parquet and CSV (docs/motions.md)."""
