"""Checks that authors of packages with entry points of scenegen run in a test of their own (docs/extending.md)."""

from scenegen.worlds.conformance import check_exporter

__all__ = ["check_exporter"]
