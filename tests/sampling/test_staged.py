"""Rejection scores what is cheap first: the same scenes as if all were scored, for less work."""

import numpy as np
import pytest

from scenegen.lang.checker import check_text
from scenegen.sampling import choice
from scenegen.sampling.problem import PLAN, Budget, make_problem
from scenegen.sampling.rejection import draw, sampler
from scenegen.sampling.rejection import draw as module
from scenegen.sampling.rejection.draw import draw_kept, make_stages
from scenegen.sampling.rejection.trial import make_trial, search
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import Effort, per_scene
from scenegen.search.prune import box_cover

TABLE = """workspace [0, 1.2] x [0, 0.8]
object box[{many}] = box(8 cm, 6 cm, 6 cm)
def nextTo(a, b, e = 10 cm) = fullyRightOf(a, b) & gap(a, b) <= e & alignedY(a, b, 5 cm)
require noOverlap() & insideWorkspace()
"""
COUNT = 16_384


def planned(task, wanted, n=100, many=5):
    spec = check_text(TABLE.format(many=many) + task)
    return make_problem(spec, SampleRequest(wanted, n=n, seed=4))


def whole_box(problem):
    return box_cover(problem.core, problem.lowest, problem.highest, {}, (0, PLAN), problem.tape, Effort())


@pytest.mark.long
@pytest.mark.parametrize(
    ("task", "wanted"),
    [
        ("task: nextTo(box[2], box[1]) & facing(box[3], box[1], 40 deg)\n", {"task": Range(-0.2, None)}),
        (
            "task: x(box[1]) >= 0.2\nsafe: facing(box[3], box[1], 20 deg) | leftOf(box[2], box[3])\n",
            {"task": Range(None, 0.3), "safe": Range(-0.2, 0.0)},
        ),
        ("task: (leftOf(box[1], box[2]) | nextTo(box[2], box[1])) & !closeTo(box[1], box[3], 0.2)\n", {}),
    ],
)
def test_the_same_scenes_to_the_bit(task, wanted, monkeypatch):
    problem = planned(task, wanted)
    cover = whole_box(problem)

    def drawn(stages):
        return draw_kept(problem, cover, COUNT, np.random.default_rng(7), stages=stages)

    stages = make_stages(problem, cover)
    monkeypatch.setattr(module, "FEW", 0)
    whole, staged = drawn(None), drawn(stages)
    assert stages.stages
    for one, other in zip(whole, staged, strict=True):
        assert one.tobytes() == other.tobytes()
    assert len(staged[2]) > 20


@pytest.mark.long
def test_conditions_are_those_of_the_range():
    """A conjunction is met where each argument is, a disjunction is missed where each is: else a label stays whole."""
    task = "task: (leftOf(box[1], box[2]) | nextTo(box[2], box[1])) & !closeTo(box[1], box[3], 0.2)\n"
    both = planned(task, {"task": Range(0.0, 0.1)})
    either = planned("task: leftOf(box[1], box[2]) | closeTo(box[1], box[3])\n", {"task": Range(0.0, None)})
    missed = planned("task: leftOf(box[1], box[2]) | closeTo(box[1], box[3])\n", {"task": Range(None, -0.1)})

    def of_task(problem):
        own = module._arguments(problem.core, problem.core.labels["require"], "min")
        return [one for one in module._conditions(problem) if one.node not in own]

    assert [one.low for one in of_task(both)] == [0.0, 0.0, -np.inf]
    assert [one.node for one in of_task(either)] == [either.core.labels["task"]]
    assert len(of_task(missed)) == 2
    assert {one.high for one in of_task(missed)} == {-0.1}


def test_conditions_that_are_the_same_for_all_scenes():
    spec = check_text("object a = box(4 cm, 4 cm, 4 cm), b\ntask: height(a) <= 5 cm & facing(a, b, 5 deg)\n")
    problem = make_problem(spec, SampleRequest({"task": Range(0.0, None)}, n=100))
    stages = make_stages(problem, whole_box(problem))
    assert [len(stage.conditions) for stage in stages.stages] in ([], [1])
    assert len(draw_kept(problem, whole_box(problem), COUNT, np.random.default_rng(0), stages=stages)[2])


@pytest.mark.long
def test_the_cheap_and_rare_comes_first():
    task = "task: nextTo(box[2], box[1]) & facing(box[3], box[1], 10 deg)\n"
    problem = planned(task, {"task": Range(0.0, None)}, many=8)
    stages = make_stages(problem, whole_box(problem))
    first = problem.core.nodes[stages.stages[0].conditions[0].node]
    assert first.text.startswith(("facing(", "alignedY("))
    assert stages.work < 0.2 * per_scene(problem.core.nodes)[0]


def test_nothing_comes_first_where_nothing_is_cheap():
    alone = check_text("task: leftOf(mug, plate) & !closeTo(mug, plate, 0.25)\n")
    problem = make_problem(alone, SampleRequest({"task": Range(0.0, None)}, n=100))
    cover = make_trial(problem, Budget()).cover
    assert make_stages(problem, cover).stages == ()


def test_stages_of_a_cover_are_found_once(monkeypatch):
    """Also if the plan looks at its own work, and a search goes on for long."""
    covers = []

    def counted(problem, cover):
        covers.append(cover)
        return make_stages(problem, cover)

    for place in (draw, sampler):
        monkeypatch.setattr(place, "make_stages", counted)
    problem = planned("task: nextTo(box[2], box[1])\n", {"task": Range(0.0, None)}, n=10_000)
    found = choice.try_rejection(problem, Budget(60.0), choice.FIRST)
    assert found.plan.sources[0].stages is found.trial.stages is not None and found.plan.seconds > 0.0
    more = search(problem, found.trial, Budget(60.0))
    assert more.stages is found.trial.stages and more.tried > found.trial.tried
    assert len(covers) == len({id(cover) for cover in covers}) == 1


@pytest.mark.long
def test_many_scenes_are_worth_rejecting_where_few_are_grown():
    """Growth pays for each scene, pruning once for all."""
    task = "task: nextTo(box[2], box[1]) & facing(box[3], box[1], 20 deg)\n"
    many = choice.choose(planned(task, {"task": Range(0.0, None)}, n=20_000, many=8), Budget(600.0))
    assert many.method == "rejection"
    rare = task.rstrip() + " & nextTo(box[5], box[4]) & facing(box[6], box[4], 20 deg) & nextTo(box[8], box[7])"
    rare += " & facing(box[8], box[4], 20 deg) & facing(box[5], box[7], 20 deg)\n"
    assert choice.choose(planned(rare, {"task": Range(0.0, None)}, n=20_000, many=8), Budget(600.0)).method == "growth"
