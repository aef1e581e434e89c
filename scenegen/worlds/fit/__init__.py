"""How often a policy succeeds: predicted for a start, and estimated for all starts of the base distribution."""

from scenegen.worlds.fit.rates import allocate, base_rate

__all__ = ["allocate", "base_rate"]
