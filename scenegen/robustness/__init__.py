"""Core formula -> torch: phi, its gradient, and which atom decides."""

from scenegen.robustness.compile import Robustness

__all__ = ["Robustness"]
