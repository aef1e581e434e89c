"""Machines of growth for specs in a line, and plain uniform scenes to hold them against."""

import numpy as np

from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import evaluate
from scenegen.sampling.growth.insertion import new_clauses, open_ways, update_choices
from scenegen.sampling.growth.model import Particles, make_growth_model
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest

POSITIVE = {"task": Range(0.0)}


def posed(text, ranges=POSITIVE, n=16, seed=0, spread="base", fixed=None):
    return make_problem(check_text(text), SampleRequest(ranges, n=n, seed=seed, spread=spread, fix=fixed or {}))


def machine_of(text, ranges=POSITIVE, **words):
    return make_growth_model(posed(text, ranges, **words))


def anywhere(problem, count, seed=0):
    """Uniform scenes, requirements not looked at, (3N, count)."""
    lowest, highest = problem.lowest[:, None], problem.highest[:, None]
    return lowest + (highest - lowest) * np.random.default_rng(seed).random((len(lowest), count))


def plain(problem, count, seed=0):
    """The first `count` scenes of plain rejection in the whole range, (3N, count)."""
    kept, found, chunk = [], 0, 1 << 14
    while found < count:
        rows = anywhere(problem, chunk, [seed, len(kept)])
        kept.append(rows[:, problem.cells.find(problem.phi(rows)) >= 0])
        found += kept[-1].shape[1]
        assert len(kept) < 400
    return np.concatenate(kept, axis=1)[:, :count]


def node_values(core, rows):
    """The value of every node in every scene by the scalar interpreter, (nodes, B)."""
    return np.array([evaluate(core, scene.tolist()) for scene in rows.T], dtype=np.float64).T


def everything_placed(model, rows, seed=0, stage=None):
    """Scenes (3N, P) as particles of which the objects up to `stage`, or all, are placed."""
    count = rows.shape[1]
    zeros = np.zeros(count, dtype=np.intp)
    particles = Particles.start(model, zeros, zeros, np.random.default_rng(seed))
    particles.scenes = rows.copy()
    particles.stage = len(model.order) - 1 if stage is None else stage
    update_choices(particles, new_clauses(model, particles.stage))
    return particles


def ways_held(model, choice, rows, stage=None):
    """Which ways of a choice nothing placed by a stage, or at all, rules out: (W, B)."""
    numbers = range(len(model.graph.choices[choice].ways))
    stage = len(model.order) - 1 if stage is None else stage
    (held,) = open_ways(model, {choice: numbers}, list(rows), np.zeros(rows.shape[1], dtype=np.intp), stage)
    return held
