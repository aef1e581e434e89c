"""phi over time against rtamt 0.4.10 (discrete time, offline), an independent monitor: at every moment, not only the
first, for random formulas with operators of time inside each other, in both conventions of until.

RTAMT_PAIRS says how many pairs of formula and trace; `make test-monitors` tries 100,000.
"""

import math
import os

import numpy as np
import pytest
import torch

from scenegen.errors import SpecError
from scenegen.lang.checker import check_text
from scenegen.learn.robustness.traces import TraceRobustness

rtamt = pytest.importorskip("rtamt", reason='rtamt is not installed: pip install -e ".[monitors]"')

PAIRS = int(os.environ.get("RTAMT_PAIRS", "100"))
TRACES = 10  # of each formula
DEPTH, T, SIGNALS = 5, 12, 3


def random_formula(rng, depth):
    """(ours, rtamt's), as text."""
    if depth == 0 or rng.random() < 0.15:
        signal, limit = rng.integers(SIGNALS), round(float(rng.normal()), 3)
        sign = rng.choice([">=", "<="])
        shown = f"{limit:.3f}"
        return f"x(o{signal}) {sign} {shown}", f"(o{signal} {sign} {shown})"
    kind = rng.choice(
        ["not", "and", "or", "implies", "always", "eventually", "until", "until_with", "next", "weak next", "unbounded"]
    )
    ours, theirs = random_formula(rng, depth - 1)
    if kind == "not":
        return f"!({ours})", f"(not {theirs})"
    if kind == "next":
        return f"next ({ours})", f"(s_next {theirs})"
    if kind == "weak next":
        return f"!next !({ours})", f"(next {theirs})"
    a = int(rng.integers(0, T + 1))
    b = int(rng.integers(a, T + 4))
    if kind in ("always", "eventually"):
        return f"{kind}[{a}, {b}] ({ours})", f"({kind}[{a}:{b}] {theirs})"
    if kind == "unbounded":
        word = str(rng.choice(["always", "eventually"]))
        return f"{word} ({ours})", f"({word} {theirs})"
    more, other = random_formula(rng, depth - 1)
    if kind in ("and", "or", "implies"):
        return f"({ours}) {kind} ({more})", f"({theirs} {kind} {other})"
    window, slot = (f"[{a}, {b}]", f"[{a}:{b}]") if rng.random() < 0.7 else ("", "")
    if kind == "until_with":  # rtamt has no operator for it
        other = f"({theirs} and {other})"
    return f"({ours}) {kind}{window} ({more})", f"({theirs} until{slot} {other})"


def monitor(formula):
    spec = rtamt.StlDiscreteTimeSpecification()
    for k in range(SIGNALS):
        spec.declare_var(f"o{k}", "float")
    spec.declare_var("out", "float")
    spec.spec = f"out = {formula}"
    spec.parse()
    return spec


def differences(seed, formulas):
    """The largest difference over formulas, traces and moments; how many formulas were compared and refused."""
    rng = np.random.default_rng(seed)
    objects = ", ".join(f"o{k}" for k in range(SIGNALS))
    worst, compared, refused = 0.0, 0, 0
    while compared < formulas:
        ours, theirs = random_formula(rng, DEPTH)
        poses = np.zeros((TRACES, T + 1, SIGNALS, 3))
        poses[..., 0] = rng.normal(size=poses.shape[:3])
        spec = monitor(theirs)
        expected = np.array(
            [
                [value for _, value in spec.evaluate({"time": list(range(T + 1))} | columns(trace))]
                for trace in poses[..., 0]
            ]
        )
        try:
            run = TraceRobustness(check_text(f"time {T} steps\nobject {objects}\ntask: {ours}").timed)
        except SpecError as error:
            assert {one.code for one in error.diagnostics} == {"looks-beyond"}, ours
            assert np.isinf(expected[:, 0]).all(), ours
            refused += 1
            continue
        found = run(torch.from_numpy(poses), signals=True)[..., 0].numpy()
        endless = np.isinf(expected)
        assert (found[endless] == expected[endless]).all() and np.isfinite(found[~endless]).all(), ours
        worst = max(worst, float(np.abs(found[~endless] - expected[~endless]).max(initial=0.0)))
        compared += 1
    return worst, compared, refused


def columns(trace):
    return {f"o{k}": trace[:, k].tolist() for k in range(SIGNALS)}


def test_phi_is_that_of_rtamt(record_property):
    worst, compared, refused = differences(seed=0, formulas=math.ceil(PAIRS / TRACES))
    record_property("worst", worst)
    print(f"{compared * TRACES:,} pairs at {T + 1} moments: differences up to {worst:g}; {refused:,} formulas refused")
    assert worst <= 1e-12
