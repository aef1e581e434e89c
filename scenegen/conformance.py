"""Checks that authors of packages with entry points of scenegen run in a test of their own (docs/extending.md,
docs/policies.md)."""

from scenegen.play.conformance import check_policy, check_world
from scenegen.worlds.conformance import check_exporter

__all__ = ["check_exporter", "check_policy", "check_world"]
