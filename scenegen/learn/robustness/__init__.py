"""Core formula -> torch: phi, its gradient, and which atom decides."""

from scenegen.learn.robustness.compile import Robustness

__all__ = ["Robustness"]
