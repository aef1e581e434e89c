"""The command line: one verb per file."""

from scenegen.cli.app import main

__all__ = ["main"]
