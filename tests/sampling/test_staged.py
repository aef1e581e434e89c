"""Rejection scores what is cheap first: the same scenes as if all were scored, for less work."""

import numpy as np
import pytest

from scenegen.bounds.effort import per_scene
from scenegen.lang.check import check_text
from scenegen.sampling import auto
from scenegen.sampling.problem import PLAN, Budget, make_problem
from scenegen.sampling.rejection import draw as module
from scenegen.sampling.rejection.draw import candidates, draw_kept, work_each
from scenegen.sampling.rejection.trial import make_trial
from scenegen.sampling.request import Range, SampleRequest

TABLE = """workspace [0, 1.2] x [0, 0.8]
object box[{many}] = box(8 cm, 6 cm, 6 cm)
def nextTo(a, b, e = 10 cm) = fullyRightOf(a, b) & gap(a, b) <= e & alignedY(a, b, 5 cm)
require noOverlap() & insideWorkspace()
"""
COUNT = 8_192


def planned(task, wanted, n=100, many=5):
    spec = check_text(TABLE.format(many=many) + task)
    return make_problem(spec, SampleRequest(wanted, n=n, seed=4))


@pytest.mark.long
@pytest.mark.parametrize(
    ("task", "wanted"),
    [
        ("task: nextTo(box[2], box[1])\n", {"task": Range(-0.05, None)}),
        (
            "task: x(box[1]) >= 0.2\nsafe: nextTo(box[3], box[1])\n",
            {"task": Range(None, 0.3), "safe": Range(-0.2, 0.0)},
        ),
        ("task: (leftOf(box[1], box[2]) | nextTo(box[2], box[1])) & !closeTo(box[1], box[3], 0.2)\n", {}),
    ],
)
def test_the_same_scenes_to_the_bit(task, wanted, monkeypatch):
    problem = planned(task, wanted)
    cover = make_trial(problem, Budget()).cover

    def drawn():
        return draw_kept(problem, cover, COUNT, np.random.default_rng(7))

    staged = drawn()
    monkeypatch.setattr(module, "CHEAP", 0.0)
    for one, other in zip(staged, drawn(), strict=True):
        assert one.tobytes() == other.tobytes()
    assert len(staged[2]) > 20


@pytest.mark.long
def test_the_work_of_a_candidate_counts_what_is_scored():
    problem = planned("task: nextTo(box[2], box[1])\n", {"task": Range(0.0, None)})
    cover = make_trial(problem, Budget()).cover
    whole = per_scene(problem.core.nodes)[0]
    first = module._cheap_label(problem)
    assert first is not None and first.label == list(problem.core.labels).index("task")
    rng = np.random.default_rng(np.random.SeedSequence([4, PLAN]))
    _, phi, usable = candidates(problem, cover, COUNT, rng)
    passed = np.mean(usable & (phi[first.label] >= 0.0))
    assert work_each(problem, cover, rng) == pytest.approx(first.work + passed * (whole - first.work), rel=0.1)
    assert first.work < work_each(problem, cover, rng) < whole


def test_nothing_comes_first_where_nothing_is_cheap():
    alone = check_text("task: leftOf(mug, plate) & !closeTo(mug, plate, 0.25)\n")
    problem = make_problem(alone, SampleRequest({"task": Range(0.0, None)}, n=100))
    assert module._cheap_label(problem) is None
    cover = make_trial(problem, Budget()).cover
    assert work_each(problem, cover, np.random.default_rng(0)) == per_scene(problem.core.nodes)[0]


@pytest.mark.long
def test_many_scenes_are_worth_rejecting_where_few_are_grown():
    """Growth pays for each scene, pruning once for all."""
    task = "task: nextTo(box[2], box[1]) & facing(box[3], box[1], 20 deg)\n"
    many = auto.choose(planned(task, {"task": Range(0.0, None)}, n=20_000, many=8), Budget())
    assert many.method == "rejection"
    rare = task.rstrip() + " & nextTo(box[5], box[4]) & facing(box[6], box[4], 20 deg) & nextTo(box[8], box[7])\n"
    assert auto.choose(planned(rare, {"task": Range(0.0, None)}, n=20_000, many=8), Budget()).method == "growth"
