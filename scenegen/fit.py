"""How often a policy succeeds: predicted for a start, and estimated for all starts of the base distribution.

from scenegen.fit import fit_outcomes
fit = fit_outcomes(["outcomes.jsonl"], "suite/")
rates = fit.predict(scenes)
"""

from scenegen.learn.success.fit import Fit, TaskFit
from scenegen.learn.success.rates import allocate, strata
from scenegen.learn.success.statistics import base_rate
from scenegen.play.fit import fit_outcomes

__all__ = ["Fit", "TaskFit", "allocate", "base_rate", "fit_outcomes", "strata"]
