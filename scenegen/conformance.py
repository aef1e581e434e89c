"""Checks that authors of packages with entry points of scenegen run in a test of their own (docs/extending.md)."""

from scenegen.play.conformance import check_policy, check_world

__all__ = ["check_policy", "check_world"]
