"""How often a policy succeeds: predicted for a start, and estimated for all starts of the base distribution."""

from scenegen.worlds.fit.fit import Fit, TaskFit, fit_outcomes
from scenegen.worlds.fit.rates import allocate, base_rate, strata

__all__ = ["Fit", "TaskFit", "allocate", "base_rate", "fit_outcomes", "strata"]
