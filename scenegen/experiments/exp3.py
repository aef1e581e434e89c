"""Experiment 3: N blocks in order, left to right, right to left, upwards or downwards (Fig. 9)."""

from __future__ import annotations

import torch

from scenegen.experiments.charts import check_libraries
from scenegen.experiments.compare import Comparison, compare
from scenegen.experiments.figures.orderings import orderings
from scenegen.experiments.known import DIFFERENCES, EVERYWHERE
from scenegen.experiments.measure import columns, phi_of
from scenegen.experiments.plan import Plan
from scenegen.experiments.problems import PROBLEMS
from scenegen.experiments.report import Report, listed, picture
from scenegen.experiments.tables import best, data, tables

BLOCKS = (3, 5, 7)
WANTED = (0.05, 0.1)


def run(plan: Plan) -> Report:
    """The tables and Fig. 9 for 3, 5 and 7 blocks."""
    check_libraries()
    blocks, pages, facts, figures = [], [], [], {}
    for count in BLOCKS:
        found = compare(plan, PROBLEMS[f"exp3_{count}"])
        blocks += tables(found)
        facts.append(data(found))
        name = f"exp3_fig9_{count}.png"
        figures[name] = _figure(found, plan.sizes.scenes)
        pages.append(
            picture(
                name,
                f"Fig. 9 of the paper, {count} blocks",
                f"The first raw scene of each ordering that our best model ({best(found).name}) draws at phi = 0.05 and"
                " 0.1; the red bar is as long as phi and stands at the pair that is closest along the order, its dotted"
                " line leads to the other block.",
            )
        )
    text = [
        *blocks,
        "## Figures",
        *pages,
        "## Where the paper's text and its published code differ",
        listed([*DIFFERENCES["exp3"], EVERYWHERE]),
    ]
    return Report("exp3", "Experiment 3", text, {"comparison": facts}, figures)


def _figure(found: Comparison, count: int) -> bytes:
    shown, spec = best(found).name, found.spec
    model = found.models[shown]
    sets = {}
    for wanted in WANTED:
        phi = columns({"sorted": wanted}, spec.labels, count)
        sets[wanted] = model.trained.propose(phi, torch.Generator().manual_seed(9)).double().numpy()
    errors = ", ".join(f"{abs(phi_of(spec, rows) - wanted).mean():.3f}" for wanted, rows in sets.items())
    words = f"{found.problem.blocks} blocks, {shown}, raw; mean absolute error {errors}"
    return orderings(sets, words)
