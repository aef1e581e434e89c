"""Experiment 2: a table set for one, so rare that uniform scenes hardly show it (Fig. 1 and 8)."""

from __future__ import annotations

import numpy as np

from scenegen.experiments.charts import check_libraries
from scenegen.experiments.compare import Comparison, compare
from scenegen.experiments.figures.overlay import overlay
from scenegen.experiments.figures.setting import setting
from scenegen.experiments.known import DIFFERENCES, EVERYWHERE
from scenegen.experiments.measure import Array, phi_of
from scenegen.experiments.plan import Plan
from scenegen.experiments.problems import BAND, PROBLEMS
from scenegen.experiments.report import Report, listed, picture
from scenegen.experiments.tables import data, tables
from scenegen.experiments.variants import VARIANTS

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
    blocks = [
        *tables(found),
        "## Figures",
        picture(
            "exp2_fig1.png",
            "Fig. 1 of the paper",
            f"A table set for one, phi = {phi:.3f}; drawn by the exact sampler, which was also told"
            " that nothing may overlap or stick out.",
        ),
        picture(
            "exp2_fig8.png",
            "Fig. 8 of the paper",
            f"Up to {sizes.overlaid} scenes on top of each other, phi = 0.03: where the centres"
            " are, and the knife as it lies. The number of scenes is in brackets; models are shown raw. Training scenes"
            f" are the boosted ones within {BAND} of 0.03, or the nearest to it where none are.",
        ),
        "## Where the paper's text and its published code differ",
        listed([*DIFFERENCES["exp2"], EVERYWHERE]),
    ]
    figures = {"exp2_fig1.png": set_table, "exp2_fig8.png": overlay(found.spec, sets, sizes.overlaid)}
    facts = {"comparison": [data(found)], "fig1": {"task": phi}}
    return Report("exp2", "Experiment 2", blocks, facts, figures)


def near(found: Comparison, most: int) -> Array:
    """The paper's training scenes whose phi is nearest to the wanted one, those of the band at most."""
    rows = found.training[PAPER]
    off = abs(phi_of(found.spec, rows)[0] - found.problem.wanted["task"])
    inside = max(1, int((off <= BAND).sum()))
    return rows[:, np.argsort(off, kind="stable")[: min(most, inside)]]
