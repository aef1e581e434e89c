"""One motion in numpy: the values are those of torch, and what decides phi is worth phi at its moment."""

import numpy as np
import torch
from hypothesis import given, settings

import scenegen
from scenegen.api.monitor import score_trajectory
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import gated
from scenegen.lang.formula.interpret import evaluate
from scenegen.lang.formula.timed import score
from scenegen.learn.robustness import Robustness
from scenegen.learn.robustness.traces import TraceRobustness

from ..laws import examples
from .slow_time import text
from .test_traces import OBJECTS, T, formulas, motions, seeds
from .unroll import unroll


@settings(max_examples=examples(200), deadline=None, derandomize=True)
@given(formulas, seeds)
def test_what_decides_is_worth_phi(formula, seed):
    try:
        timed = check_text(f"time {T} steps\n{OBJECTS}task: {text(formula)}").timed
    except scenegen.SpecError:
        return
    poses = motions(seed, 1)
    scored = score(timed, poses[0].numpy())
    assert scored.signals["task"].tolist() == TraceRobustness(timed)(poses, signals=True)[0, :, 0].tolist()
    atom, moment = scored.decides("task")
    margin = scored.states[atom.margin][moment]
    assert margin == scored.phi["task"] and 0 <= moment <= T


def test_steps_and_requirements():
    spec = scenegen.parse(
        "time [0, 1 s] every 0.5 s object a, b require speed(a) <= 1 m/s require x(a) >= 0 "
        "task: eventually moved(a, 10 cm) gone: leftOf(a, b) until carried(b, a)"
    )
    poses = np.zeros((3, 2, 3))
    poses[:, 0, 0] = 0.1, 0.1, 0.5
    poses[:, 1, 0] = 0.2, 0.3, 0.3
    scored = score_trajectory(spec, poses)
    assert (scored.decides("task").atom.text, scored.decides("task").moment) == ("moved(a, 0.1)", 2)
    assert np.isclose(scored.phi["task"], 0.3)
    assert np.isclose(scored.required.min(), 0.1)
    atom, moment = scored.decides(None)
    assert (atom.text, moment) == ("0 <= x(a)", 0) or (atom.text, moment) == ("x(a) >= 0", 0)
    run = spec.trace_robustness()
    assert torch.allclose(run(torch.from_numpy(poses)[None])[0], torch.tensor([*scored.phi.values()]).double())


@settings(max_examples=examples(120), deadline=None, derandomize=True)
@given(formulas, seeds)
def test_unrolled_it_is_a_formula_of_one_scene(formula, seed):
    try:
        timed = check_text(f"time {T} steps\n{OBJECTS}require {text(formula)}\ntask: {text(formula)}").timed
    except scenegen.SpecError:
        return
    core = unroll(timed)
    assert core.objects[:4] == ("o0 at 0", "o1 at 0", "o2 at 0", "o0 at 1")
    poses = motions(seed, 2)
    run = TraceRobustness(timed)
    for motion, expected, required in zip(poses, run(poses)[:, 0].tolist(), run.required(poses).tolist(), strict=True):
        values = evaluate(core, motion.reshape(-1).tolist())
        assert values[core.labels["task"]] == expected
        assert values[core.requirement] == required


def test_unrolled_steps():
    timed = scenegen.parse(
        "time 3 steps object a, b require speed(a) <= 0.5 m/s task: eventually moved(a, 10 cm) & always carried(b, a)"
    ).over_time
    core = unroll(timed)
    poses = torch.rand(5, 4, 2, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    run = TraceRobustness(timed)
    still = Robustness(core)
    assert torch.equal(still(poses.reshape(5, 8, 3)), run(poses))
    assert torch.equal(Robustness(gated(core))(poses.reshape(5, 8, 3))[:, 1], run.required(poses))
