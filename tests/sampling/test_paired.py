"""Parts of a request that share no clause are sampled apart: the same law, at the sum of their costs."""

import math
from dataclasses import replace

import numpy as np
import pytest

import scenegen
from experiments.metrics import energy_test, ks_screen
from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.sampling import problem as module
from scenegen.sampling.engine.run import draw, in_memory
from scenegen.sampling.methods import make_plan
from scenegen.sampling.parts import independent_parts, pair
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import StoppedError

LEVEL = 0.99
ODDS = math.acos(LEVEL) / math.pi  # of sin(20 theta) >= LEVEL: twenty whole waves
SATISFIED = {"task": Range(0.0)}


def wave(*names):
    """A margin that no box of poses narrows down."""
    return " * ".join(f"sin(20 * theta({name}))" for name in names) + f" >= {LEVEL}"


TWO = f"object a, b, free\ntask: {wave('a')} & x(a) + y(a) >= 1 & {wave('b')} & x(b) * y(b) >= 0.1"
RARE = f"task: {wave('a', 'b')} & {wave('c', 'd')}"  # one scene of 100,000
REQUIRED = f"object a, b\nrequire {wave('b')}\ntask: {wave('a')}"


def paired(problem, method="rejection"):
    parts = independent_parts(problem, Budget())
    return pair(problem, parts, [make_plan(part.problem, Budget(), method=method) for part in parts])


def drawn(plan, workers=1):
    request = replace(plan.problem.request, workers=workers)
    return in_memory(replace(plan, problem=replace(plan.problem, request=request)), Budget())


def objects(text, ranges=SATISFIED, **words):
    problem = make_problem(check_text(text), SampleRequest(ranges, n=10, **words))
    return [
        tuple(problem.core.objects[thing] for thing in part.objects) for part in independent_parts(problem, Budget())
    ]


def test_what_counts_as_a_part():
    assert objects(TWO) == [("a",), ("b",)]
    assert objects(REQUIRED) == [("a",), ("b",)]
    assert objects(f"task: {wave('a', 'b')} & {wave('b', 'c')}") == []
    assert objects(f"task: {wave('a', 'b')} & {wave('c')} & leftOf(b, c)") == []
    # disjunctions tie their objects together
    assert objects(f"task: {wave('a')} & ({wave('b')} | {wave('c')}) & {wave('d')} & {wave('c')}") == [
        ("a",),
        ("b", "c"),
        ("d",),
    ]
    # what most scenes meet is taken together, and one rare part is no reason to take a request apart
    common = "x(c) >= 0.1 & x(d) >= 0.1"
    assert objects(f"task: {wave('a')} & {wave('b')} & {common}") == [("a",), ("b",), ("c", "d")]
    assert objects(f"task: {wave('a')} & {common}") == []
    # which many of them together are
    halves = " & ".join(f"sin(20 * theta({name})) >= 0" for name in "abcdef")
    assert list(map(len, objects(f"task: {halves}"))) == [2, 2, 2]


def test_an_upper_end_parts_a_disjunction():
    text = f"task: !({wave('a')}) | !({wave('b')})"
    assert objects(text, {"task": Range(None, 0.0)}) == [("a",), ("b",)]
    assert objects(text, {"task": Range(-0.01, 0.0)}) == []
    plan = paired(make_problem(check_text(text), SampleRequest({"task": Range(None, 0.0)}, n=200)))
    found = drawn(plan)
    assert found.count == 200 and np.sin(20 * found.rows[2::3]).min() >= LEVEL


def test_labels_that_scenes_are_spread_over_stay_together():
    text = f"object a, b, c\none: {wave('a')}\ntwo: {wave('b')}\nrequire {wave('c')}\n"
    assert objects(text, {"one": Range(0.0), "two": Range(0.0)}) == [("a",), ("b",), ("c",)]
    flat = {"one": Range(0.0, 0.01), "two": Range(0.0, 0.01)}
    assert objects(text, flat) == [("a", "b"), ("c",)]
    assert objects(text, flat, spread="base") == [("a",), ("b",), ("c",)]


def test_the_law_is_that_of_rejection():
    """And the tests see it where scenes of the parts are not paired at random."""
    problem = make_problem(check_text(TWO), SampleRequest(SATISFIED, n=2000, seed=4))
    truth = drawn(make_plan(problem, Budget(), method="rejection"))
    plan = paired(problem)
    assert all(one.expected < 200_000 for one in plan.plans)
    made = drawn(plan)
    rng = np.random.default_rng(0)
    assert ks_screen(truth.rows, made.rows).corrected > 0.01
    assert energy_test(truth.rows, made.rows, rng, permutations=99).p > 0.01
    wrong = made.rows.copy()
    wrong[:3], wrong[3:6] = wrong[:3, np.argsort(wrong[0])], wrong[3:6, np.argsort(wrong[3])]
    assert ks_screen(truth.rows, wrong).corrected <= 0.01


def test_equal_parts_do_not_share_random_numbers():
    made = drawn(paired(make_problem(check_text(f"task: {wave('a')} & {wave('b')}"), SampleRequest(SATISFIED, n=500))))
    assert abs(np.corrcoef(made.rows[0], made.rows[3])[0, 1]) < 0.2
    assert not set(made.rows[0].tolist()) & set(made.rows[3].tolist())


def test_probabilities_add_up():
    plan = paired(make_problem(check_text(REQUIRED), SampleRequest(SATISFIED, n=500, seed=1)))
    info = drawn(plan).info
    one, two = info["components"]
    assert info["method"] == "paired" and [one["objects"], two["objects"]] == [["a"], ["b"]]
    assert info["log10_probability"] == pytest.approx(one["log10_probability"] + two["log10_probability"], abs=1e-4)
    assert info["log10_error"] == pytest.approx(math.hypot(one["log10_error"], two["log10_error"]), abs=1e-4)
    assert abs(info["log10_probability"] - 2 * math.log10(ODDS)) < 2 * info["log10_error"] < 0.1
    assert info["probability_of"] == "range and requirement"


def test_every_method_can_have_a_part():
    """Their facts differ in number, and none gets those of another."""
    problem = make_problem(
        check_text(f"task: {wave('a')} & {wave('b')} & {wave('c')}"), SampleRequest(SATISFIED, n=200)
    )
    parts = independent_parts(problem, Budget())
    methods = ("growth", "splitting", "rejection")
    plans = [make_plan(part.problem, Budget(), method=method) for part, method in zip(parts, methods, strict=True)]
    plan = pair(problem, parts, plans)
    found = drawn(plan)
    assert found.count == 200 and np.sin(20 * found.rows[2::3]).min() >= LEVEL
    assert found.info["pieces"] >= plan.fewest == 4 and plan.patience == 8
    for method, one in zip(methods, found.info["components"], strict=True):
        assert one["method"] == method
        assert abs(one["log10_probability"] - math.log10(ODDS)) < max(2 * one["log10_error"], 0.01)


def test_cells_and_a_requirement():
    plan = paired(make_problem(check_text(REQUIRED), SampleRequest({"task": Range(0.0, 0.008)}, n=640)))
    found = drawn(plan)
    assert plan.reached == tuple(range(32)) and found.shortfall is None
    assert (np.histogram(found.phi[0], np.linspace(0.0, 0.008, 33))[0] == 20).all()
    assert np.sin(20 * found.rows[5]).min() >= LEVEL


def test_parts_that_are_only_required():
    text = f"object a, b, c\nrequire {wave('a')}\nrequire {wave('b')}\ntask: leftOf(c, c) | x(c) >= 0.2"
    plan = paired(make_problem(check_text(text), SampleRequest(n=300)))
    assert [part.objects for part in plan.parts] == [(0,), (1,)]
    found = drawn(plan)
    assert found.count == 300 and np.sin(20 * found.rows[[2, 5]]).min() >= LEVEL
    assert 0.4 < found.rows[6].mean() < 0.6


def test_objects_that_are_held():
    text = f"task: {wave('a')} & {wave('b')} & {wave('c', 'd')}"
    fixed = {"d": (0.5, 0.5, math.pi / 40), "a": (0.25, 0.75)}
    assert objects(text, fix=fixed) == [("a",), ("b",), ("c",)]
    found = drawn(paired(make_problem(check_text(text), SampleRequest(SATISFIED, n=200, fix=fixed))))
    assert found.count == 200
    assert (found.rows[:2] == [[0.25], [0.75]]).all() and (found.rows[9:] == [[0.5], [0.5], [math.pi / 40]]).all()


@pytest.mark.long
def test_workers_change_nothing():
    plan = paired(make_problem(check_text(TWO), SampleRequest(SATISFIED, n=2000)))
    one, two = drawn(plan), drawn(plan, workers=2)
    assert one.rows.tobytes() == two.rows.tobytes() and one.info == two.info


@pytest.mark.long
def test_a_run_is_resumed(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "GRACE", 60.0)
    spec, path = scenegen.parse(RARE), tmp_path / "x.jsonl"
    words = {"phi": {"task": (0.0, None)}, "n": 1500}
    with pytest.raises(RequestError, match=r"found [\d,]+ of 1,500 scenes in 2 parts"):
        scenegen.sample_to(path, spec, **words, timeout=1e-6)
    scenegen.sample_to(path, spec, **words, resume=True)
    written = scenegen.sample_to(tmp_path / "whole.jsonl", spec, **words)
    assert written.header.sampler["method"] == "paired" and written.header.sampler["pieces"] > 1
    assert path.read_bytes() == (tmp_path / "whole.jsonl").read_bytes()


def test_auto_takes_a_dear_request_apart():
    problem = make_problem(check_text(RARE), SampleRequest(SATISFIED, n=1000))
    choice = make_plan(problem, Budget(), method="auto")
    assert choice.method == "paired" and choice.why == "2 parts share no clause: rejection, rejection"
    assert choice.plan_digest == make_plan(problem, Budget(), method="auto").plan_digest
    assert (
        choice.plan_digest
        != make_plan(
            make_problem(problem.spec, SampleRequest(SATISFIED, n=1000, seed=1)), Budget(), method="auto"
        ).plan_digest
    )


def test_auto_leaves_a_cheap_one_whole():
    assert (
        make_plan(make_problem(check_text(TWO), SampleRequest(SATISFIED, n=100)), Budget(), method="auto").method
        == "rejection"
    )


def test_pieces_are_of_a_size():
    """A common part does not draw what a rare one cannot be paired with."""
    text = f"task: {wave('a')} & {wave('b', 'c')}"
    plan = paired(make_problem(check_text(text), SampleRequest(SATISFIED, n=50_000)))
    one, two = (piece.rows.shape[1] for piece in (part.draw(0) for part in plan.plans))
    assert 0.7 < one / two < 1.6


def test_time_is_up(monkeypatch):
    problem = make_problem(check_text(TWO), SampleRequest(SATISFIED, n=100))
    monkeypatch.setattr(module, "GRACE", 0.0)
    with pytest.raises(RequestError, match="time was up"):
        independent_parts(problem, Budget(0.0))


def test_time_is_up_within_a_part():
    plan = paired(make_problem(check_text(TWO), SampleRequest(SATISFIED, n=100)))

    class Slow:
        def __getattr__(self, name):
            return getattr(plan.plans[1], name)

        def draw(self, k):
            raise StoppedError

    found = drawn(replace(plan, plans=(plan.plans[0], Slow())))
    assert found.count == 0 and "found none of 100 scenes in 2 parts" in found.shortfall.title


@pytest.mark.slow
def test_rare_parts_cost_their_sum():
    """Each occurs in one scene of 30,000 or so, both in one of a thousand million."""
    one = " * ".join(f"sin(20 * theta({name}))" for name in "ab") + " >= 0.9999"
    two = one.replace("(a)", "(c)").replace("(b)", "(d)")
    alone, both = (
        make_problem(check_text(f"task: {text}"), SampleRequest(SATISFIED, n=1000)) for text in (one, f"{one} & {two}")
    )
    single, found = (draw(each, Budget(600)) for each in (alone, both))
    assert found.count == 1000 and found.info["method"] == "paired"
    # u^2 + v^2 <= 2e-4 about each of the two peaks of a cell of 4 pi^2, to first order
    odds = 2 * math.log10(2 * math.pi * 2e-4 / (4 * math.pi**2))
    assert abs(found.info["log10_probability"] - odds) < 1.5 * found.info["log10_error"] < 1.0  # of four pieces
    evaluations = single.info.get("candidates", single.info.get("draws"))
    assert found.info["candidates"] < 4 * evaluations
