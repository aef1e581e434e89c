"""How often a policy succeeds: predicted for a start, and estimated for all starts of the base distribution."""

from scenegen.play.fit.fit import Fit, TaskFit, fit_outcomes
from scenegen.play.fit.rates import allocate, strata
from scenegen.play.suites.statistics import base_rate

__all__ = ["Fit", "TaskFit", "allocate", "base_rate", "fit_outcomes", "strata"]
