"""Experiment 3: N blocks in order, left to right, right to left, upwards or downwards (Fig. 9)."""

from __future__ import annotations

import torch

from experiments.charts import check_libraries
from experiments.compare import Comparison, compare
from experiments.figures.orderings import orderings
from experiments.measure import columns, phi_of
from experiments.page import picture
from experiments.plan import Plan
from experiments.problems import PROBLEMS
from experiments.report import Report
from experiments.tables import best, data, tables

BLOCKS = (3, 5, 7)
WANTED = (0.05, 0.1)


def run(plan: Plan) -> Report:
    """The tables and Fig. 9 for 3, 5 and 7 blocks."""
    check_libraries()
    blocks, facts, figures = dict[str, str](), [], {}
    for count in BLOCKS:
        found = compare(plan, PROBLEMS[f"exp3_{count}"])
        blocks |= tables(found)
        facts.append(data(found))
        name = f"exp3_fig9_{count}.png"
        figures[name] = _figure(found, plan.sizes.scenes)
        blocks[f"exp3_{count}-fig9"] = picture(name, f"Fig. 9 of the paper, {count} blocks")
    return Report("exp3", "Experiment 3", blocks, {"comparison": facts}, figures)


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
