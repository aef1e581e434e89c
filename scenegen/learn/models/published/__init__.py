"""The networks of the published code, as they are: `--recipe paper`."""
