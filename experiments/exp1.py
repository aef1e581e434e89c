"""Experiment 1: a mug to the upper left of a plate and not too close, queried at (task, safe) (Fig. 6 and 7)."""

from __future__ import annotations

import torch

from experiments.charts import check_libraries
from experiments.compare import Comparison, compare
from experiments.figures.isomap import Query, isomap
from experiments.figures.steering import steering
from experiments.measure import Array, phi_of, rows_of
from experiments.page import picture
from experiments.plan import Plan
from experiments.problems import PROBLEMS
from experiments.report import Report
from experiments.tables import best, data, tables
from experiments.variants import VARIANTS
from scenegen.api.sample import sample

OUT_OF_REACH = {"task": -0.17, "safe": -0.09}
ROUND_IT = 0.025  # half-width of the band that is not empty
NEAR = 0.05  # training scenes this near to the query on both labels are shown: there are hundreds
PAPER = VARIANTS[0].name


def run(plan: Plan) -> Report:
    """The tables, Fig. 6 and Fig. 7."""
    check_libraries()
    problem, sizes = PROBLEMS["exp1"], plan.sizes
    found = compare(plan, problem)
    plan.tell("Experiment 1: drawing")
    shown = {name: found.models[name] for name in (PAPER, best(found).name)}
    steered, facts = steering(found.spec, shown, sizes.pixels)
    queries = [
        _query(found, "(task, safe) = (0.19, 0.08)", dict(problem.wanted), 0.0125, sizes.dots),
        _query(found, "the band of 0.025 around (-0.17, -0.09)", OUT_OF_REACH, ROUND_IT, sizes.dots),
    ]
    blocks = tables(found)
    blocks["fig6"] = picture("exp1_fig6.png", "Fig. 6 of the paper")
    blocks["fig7"] = picture("exp1_fig7.png", "Fig. 7 of the paper")
    figures = {"exp1_fig6.png": steered, "exp1_fig7.png": isomap(queries, sizes.dots, sizes.neighbours)}
    return Report("exp1", "Experiment 1", blocks, {"comparison": [data(found)], "fig6": facts}, figures)


def _query(found: Comparison, words: str, wanted: dict[str, float], half: float, dots: int) -> Query:
    """True scenes of a band, training scenes near it, and what every model draws for phi that true scenes have."""
    spec = found.spec
    band = {label: (value - half, value + half) for label, value in wanted.items()}
    truth = rows_of(sample(spec, band, dots, seed=7, spread="base", workers=1))
    phi = torch.from_numpy(phi_of(spec, truth)).float()
    sets = {"truth": truth, "training data": _near(found, wanted)}
    for name, model in found.models.items():
        drawn = model.trained.propose(phi, torch.Generator().manual_seed(7))
        sets[name] = drawn.double().numpy()
    coloured = {name: (rows, phi_of(spec, rows)[0]) for name, rows in sets.items()}
    return Query(words, wanted["task"], coloured, "truth")


def _near(found: Comparison, wanted: dict[str, float]) -> Array:
    """The paper's training scenes near a query."""
    rows = found.training[PAPER]
    phi = phi_of(found.spec, rows)
    near = abs(phi[0] - wanted["task"]) <= NEAR
    near &= abs(phi[1] - wanted["safe"]) <= NEAR
    return rows[:, near]
