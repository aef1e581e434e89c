"""The bars of issue C for two sets of scenes: energy test, Kolmogorov-Smirnov with Bonferroni, coverage."""

import math
from dataclasses import dataclass

import numpy as np
from scipy import stats

from experiments.metrics import energy_test, ks_screen
from scenegen.scenes.coverage import coverage

LEAST_P = 0.01
LEAST_COVERAGE = 0.95
COVERED = 2000  # scenes of each set, as coverage is defined in the project's reference figures
# p is a multiple of 1 / (permutations + 1): 99 can tell 0.01 from more, and take half the time of 199
PERMUTATIONS = 99


@dataclass(frozen=True)
class Verdict:
    """p-values of the tests and the coverage of one pair of sets."""

    energy: float
    screen: float
    worst: str
    coverage: float

    @property
    def covers(self):
        return self.coverage >= LEAST_COVERAGE

    @property
    def alike(self):
        return self.energy > LEAST_P and self.screen > LEAST_P and self.covers


def judge(truth, made, rng, *, short=False):
    """All bars at the full size of both sets, (3N, n) each; coverage on 2,000 of each.

    The energy test takes four seconds for 20,000: `short` leaves it out (NaN, so not alike) where the others have
    decided already.
    """
    screen = ks_screen(truth, made)
    covered = coverage(truth[:, :COVERED], made[:, :COVERED])
    if short and (screen.corrected <= LEAST_P or covered < LEAST_COVERAGE):
        return Verdict(math.nan, screen.corrected, screen.worst.name, covered)
    energy = energy_test(truth, made, rng, permutations=PERMUTATIONS, most=max(truth.shape[1], made.shape[1]))
    return Verdict(energy.p, screen.corrected, screen.worst.name, covered)


def uniform_p(answers):
    """p of the worst Kolmogorov-Smirnov test against uniform on [0, 1], times how many there are (Bonferroni)."""
    return min(1.0, len(answers) * min(stats.kstest(np.asarray(v), "uniform").pvalue for v in answers.values()))


def row(what, verdicts):
    """A line of the table in docs/experiments/exactness.md."""
    energy, screen, covered = (sorted(getattr(v, key) for v in verdicts) for key in ("energy", "screen", "coverage"))
    energy = [p for p in energy if not math.isnan(p)]
    energies = f"{energy[0]:.2f} - {energy[-1]:.2f}" if energy else "not needed"
    passed = sum(v.alike for v in verdicts)
    return (
        f"| {what} | {energies} | {screen[0]:.2g} - {screen[-1]:.2g} "
        f"| {covered[0]:.3f} - {covered[-1]:.3f} | {passed} of {len(verdicts)} |"
    )
