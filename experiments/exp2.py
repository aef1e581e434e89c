"""Experiment 2: a table set for one, so rare that uniform scenes hardly show it (Fig. 1 and 8)."""

from __future__ import annotations

import numpy as np

from experiments.charts import check_libraries
from experiments.compare import Comparison, compare
from experiments.figures.overlay import overlay
from experiments.figures.setting import setting
from experiments.measure import Array, phi_of
from experiments.page import picture
from experiments.plan import Plan
from experiments.problems import BAND, PROBLEMS
from experiments.report import Report
from experiments.tables import data, tables
from experiments.variants import VARIANTS

PAPER = VARIANTS[0].name
SETTING_WIDTH = 2.4  # times the pictures of other figures


def run(plan: Plan) -> Report:
    """The tables, Fig. 1 and Fig. 8."""
    check_libraries()
    problem, sizes = PROBLEMS["exp2"], plan.sizes
    found = compare(plan, problem)
    plan.tell("Experiment 2: drawing")
    set_table, phi = setting(round(SETTING_WIDTH * sizes.pixels))
    training = near(found, sizes.overlaid)
    sets = {"paper's training data": training, "truth": found.truth, **found.raw}
    blocks = tables(found)
    blocks["fig1"] = picture("exp2_fig1.png", "Fig. 1 of the paper")
    blocks["fig8"] = picture("exp2_fig8.png", "Fig. 8 of the paper")
    figures = {"exp2_fig1.png": set_table, "exp2_fig8.png": overlay(found.spec, sets, sizes.overlaid)}
    facts = {"comparison": [data(found)], "fig1": {"task": phi}}
    return Report("exp2", "Experiment 2", blocks, facts, figures)


def near(found: Comparison, most: int) -> Array:
    """The paper's training scenes whose phi is nearest to the wanted one, those of the band at most."""
    rows = found.training[PAPER]
    off = abs(phi_of(found.spec, rows)[0] - found.problem.wanted["task"])
    inside = max(1, int((off <= BAND).sum()))
    return rows[:, np.argsort(off, kind="stable")[: min(most, inside)]]
