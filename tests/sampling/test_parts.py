"""Parts of a request that share no clause are sampled apart: the same law, at the sum of their costs. Rejection scores
what is cheap first: the same scenes as if all were scored, for less work. Scenes of a spec that draws how many
things there are: each number has its share, and its own spec's scenes.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import scenegen
from experiments.metrics import energy_test, ks_screen
from scenegen.api.scenes import evaluate
from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Apply, Junction
from scenegen.sampling import choice
from scenegen.sampling.engine.run import in_memory
from scenegen.sampling.families import seed_of
from scenegen.sampling.growth.model import make_growth_model
from scenegen.sampling.parts import independent_parts, pair
from scenegen.sampling.plan import Tally
from scenegen.sampling.plans import draw, make_plan, plan_for
from scenegen.sampling.problem import make_problem
from scenegen.sampling.rarity import MixedTail, constant_phi, mean_estimate
from scenegen.sampling.rejection import draw as draw_staged
from scenegen.sampling.rejection import draw as module_staged
from scenegen.sampling.rejection import sampler
from scenegen.sampling.rejection.draw import draw_kept, make_stages
from scenegen.sampling.rejection.trial import make_trial, search_longer
from scenegen.sampling.request import Range, SampleRequest
from scenegen.sampling.streams import REJECTION_PLAN_STREAM
from scenegen.search import effort as module
from scenegen.search.effort import SCORE_SECONDS, SHARE_WORK, Budget, Effort, StoppedError, work_per_scene
from scenegen.search.prune import box_cover

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
    assert plan.reached_cells == tuple(range(32)) and found.shortfall is None
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
    monkeypatch.setattr(module, "GRACE_SECONDS", 60.0)
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
    monkeypatch.setattr(module, "GRACE_SECONDS", 0.0)
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
    return box_cover(
        problem.core, problem.lowest, problem.highest, {}, (0, REJECTION_PLAN_STREAM), problem.tape, Effort()
    )


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
    monkeypatch.setattr(module_staged, "MIN_STAGED", 0)
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
        own, waiting = set(), [problem.core.labels["require"]]
        while waiting:
            node = problem.core.nodes[waiting.pop()]
            if isinstance(node, Junction) and len(node.args) < module_staged.FEWEST_GAPS:
                own |= {*node.args}
                waiting += node.args
        return [one for one in module_staged._conditions(problem) if one.node not in own]

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
    assert stages.work < 0.2 * work_per_scene(problem.core.nodes)[0]


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

    for place in (draw_staged, sampler):
        monkeypatch.setattr(place, "make_stages", counted)
    problem = planned("task: nextTo(box[2], box[1])\n", {"task": Range(0.0, None)}, n=10_000, many=3)
    found = choice.try_rejection(problem, Budget(60.0), choice.FIRST_PRUNING_WORK)
    assert found.plan.sources[0].stages is found.trial.stages is not None and found.plan.seconds > 0.0
    more = search_longer(problem, found.trial, Budget(60.0))
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


SPEC = "object block[2..4], cup[1..2], mug\nrequire x(mug) >= 0.3\ntask: forall b in block: leftOf(b, mug)\n"
RARE_NUMBERED = "object block[2..4], mug\ntask: forall b in block: leftOf(b, mug) & x(mug) >= block.count * 0.3\n"


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse(SPEC)


@pytest.fixture(scope="module")
def drawn_numbered(spec):
    return scenegen.sample(spec, (0.0, 0.2), n=120, seed=1)


def test_the_numbers_are_uniform(drawn_numbered):
    combinations = drawn_numbered.counts["block"] * 10 + drawn_numbered.counts["cup"]
    _, each = np.unique(combinations, return_counts=True)
    assert each.tolist() == [20] * 6
    # in any order: the first half has about half of each
    _, first = np.unique(combinations[:60], return_counts=True)
    assert stats.chisquare(first).pvalue > 1e-3 and len(set(combinations[:12].tolist())) > 3


def test_given_the_numbers_the_scenes_are_those_of_the_ordinary_spec(spec):
    drawn = scenegen.sample(spec, (0.0, None), n=30, seed=1)
    for numbers, which in drawn.parts():
        member = spec.with_counts(numbers)
        mine = scenegen.sample(member, (0.0, None), n=5, seed=seed_of(1, numbers))
        some = drawn.only(numbers, which)
        assert some.objects == member.objects
        assert sorted(some.poses.tolist()) == sorted(mine.poses.tolist()), "the very same, in another order"


def test_absent_objects_have_no_pose_and_phi_is_that_of_the_rest(spec, drawn_numbered):
    assert (np.isnan(drawn_numbered.poses).all(axis=2) == ~drawn_numbered.present).all()
    assert (
        drawn_numbered.present.sum(axis=1) == drawn_numbered.counts["block"] + drawn_numbered.counts["cup"] + 1
    ).all()
    assert (evaluate(spec.require_scenes(), drawn_numbered)["task"] == drawn_numbered.phi["task"]).all()
    assert ((drawn_numbered.phi["task"] >= 0.0) & (drawn_numbered.phi["task"] <= 0.2)).all()
    scene = drawn_numbered[0]
    assert set(scene.poses) == {
        name for name, here in zip(drawn_numbered.objects, drawn_numbered.present[0], strict=True) if here
    }
    assert scene.counts == {name: numbers[0] for name, numbers in drawn_numbered.counts.items()}


@pytest.mark.long
def test_the_bytes_do_not_depend_on_workers_nor_on_how_they_are_written(spec, drawn_numbered, tmp_path):
    drawn_numbered.save(tmp_path / "memory.parquet")
    for name, workers in (("one", 1), ("two", 2)):
        scenegen.sample_to(tmp_path / f"{name}.parquet", spec, (0.0, 0.2), n=120, seed=1, workers=workers)
        assert (tmp_path / f"{name}.parquet").read_bytes() == (tmp_path / "memory.parquet").read_bytes()


def test_a_number_without_scenes_is_left_out_and_told():
    spec = scenegen.parse(RARE_NUMBERED)
    found = scenegen.sample(spec, (0.0, None), n=9, seed=2)
    assert (
        sorted(found.counts["block"].tolist()) == [2] * 5 + [3] * 4
        or sorted(found.counts["block"].tolist()) == [2] * 4 + [3] * 5
    )
    (warning,) = found.warnings
    assert warning.code == "number-left-out" and "block[4]" in warning.title
    assert [one["numbers"] for one in found.header.sampler["left_out"]] == [{"block": 4}]
    assert [one["share"] for one in found.header.sampler["numbers"]] == [0.5, 0.5]
    with pytest.raises(RequestError) as error:
        scenegen.sample(spec, (0.95, None), n=9)
    assert error.value.diagnostics[0].code == "no-number-possible"


SOME_BLOCKS = "object block[3..5], plate\n{}task: forall b in block: leftOf(b, plate)\n"
UNMET = "no scene meets what the spec requires"


@pytest.mark.parametrize(
    ("required", "left"),
    [
        ("require block.count >= 4\n", [4, 5]),
        ("require block.count != 4\n", [3, 5]),
        ("require (block.count <= 3 | block.count >= 5) & noOverlap()\n", [3, 5]),
        ("require noOverlap()\nrequire block.count <= 3 | block.count >= 5\n", [3, 5]),
        ("require leftOf(block[1], plate)\nrequire block.count <= 3\n", [3]),
    ],
)
def test_a_requirement_about_numbers_leaves_out_the_others_and_is_named(required, left):
    found = scenegen.sample(scenegen.parse(SOME_BLOCKS.format(required)), (0.0, None), n=6)
    assert sorted(set(found.counts["block"].tolist())) == left
    assert all(one.code == "number-left-out" and one.facts["why"] == UNMET for one in found.warnings)
    assert len(found.warnings) == 3 - len(left)


def test_a_spec_with_one_of_the_numbers_can_be_saved_and_read(tmp_path):
    spec = scenegen.parse(SOME_BLOCKS.format("require block.count >= 4\n")).with_counts({"block": 4})
    scenegen.sample(spec, (0.0, None), n=2).save(tmp_path / "four.json")
    assert len(scenegen.read_scenes(tmp_path / "four.json")) == 2


def test_a_label_about_numbers_has_a_phi_for_each():
    spec = scenegen.parse("object block[3..5], plate\nmany: block.count >= 4\ntask: leftOf(block[1], plate)\n")
    found = scenegen.sample(spec, {"task": (0.0, None)}, n=9)
    assert (found.phi["many"] == found.counts["block"] - 4).all()
    for method in ("rejection", "growth", "splitting"):
        some = scenegen.sample(spec, {"many": (0.0, None), "task": (0.0, None)}, n=6, method=method)
        assert sorted(set(some.counts["block"].tolist())) == [4, 5]


@pytest.mark.parametrize(
    ("fix", "title"),
    [({"mug": (0.5, 0.5), "plate": (0.6, 0.5)}, "no scene with `mug` and `plate` there meets"), ({}, UNMET)],
)
def test_an_impossible_requirement_is_not_blamed_on_phi(fix, title):
    clear = "clearOf(mug, plate, 10 cm)" if fix else "clearOf(mug, plate, 2 m)"
    spec = scenegen.parse(f"require {clear}\ntask: leftOf(mug, fork)\n")
    for wanted in ((0.0, None), (0.1, 0.1)):  # a range, and a single value
        with pytest.raises(RequestError) as error:
            scenegen.sample(spec, wanted, n=3, fix=fix)
        (problem,) = error.value.diagnostics
        assert problem.code == "no-such-scene" and problem.title.startswith(title)
        assert problem.span is not None and problem.span.text == clear


def test_groups_of_cells_have_equal_shares_whatever_they_reach():
    spec = scenegen.parse("object block[1..2], mug\ntask: x(mug) <= 0.4 * block.count\n")
    found = scenegen.sample(spec, (0.0, 0.8), n=64, seed=3)
    assert np.bincount(found.counts["block"]).tolist() == [0, 32, 32]
    assert found.phi["task"][found.counts["block"] == 1].max() <= 0.4


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ({"fix": {"block[4]": (0.5, 0.5)}}, "cannot-be-held"),
        ({"fix": {"blok": (0.5, 0.5)}}, "unknown-object"),
        ({"n": 0}, "out-of-range"),
        ({"method": "model"}, "without-model"),
        ({"phi": {"other": (0.0, 1.0)}}, "unknown-label"),
    ],
)
def test_a_request_that_is_wrong_is_refused(spec, options, code):
    with pytest.raises(RequestError) as error:
        scenegen.sample(spec, **{"phi": (0.0, None), "n": 2, **options})
    assert error.value.diagnostics[0].code == code


@pytest.mark.long
def test_surfaces_are_chosen_of_those_that_are_there(tmp_path):
    text = "object tray, can[1..3] on any of [tray.inside, workspace], mug on tray\n"
    found = scenegen.sample(scenegen.parse(text + "task: leftOf(mug, can[1])"), (0.0, None), n=9, seed=4)
    assert (np.isnan(found.on) == ~found.present[:, 1:4]).all()
    for ending in ("json", "jsonl", "parquet"):
        path = found.save(tmp_path / f"a.{ending}")
        again = scenegen.read_scenes(path)
        assert np.array_equal(again.on, found.on, equal_nan=True)
        assert np.array_equal(again.poses, found.poses, equal_nan=True)
    assert (
        evaluate(scenegen.parse(text + "task: leftOf(mug, can[1])").require_scenes(), again)["task"]
        == found.phi["task"]
    ).all()


def test_the_mixture_of_tails_is_the_mean():
    low, high = constant_phi(0.1), constant_phi(0.3)
    tail = MixedTail((low.up, high.up), (1, 1))
    assert (tail.end, tail.whole) == (0.3, True)
    assert 10.0 ** tail(0.2).log10 == pytest.approx(0.5) and tail(0.05).log10 == 0.0 and tail(0.4) is None
    assert tail.quantile(0.25) == 0.3 and tail.quantile(0.75) == 0.1
    often = MixedTail((low.up, high.up), (3, 1))
    assert 10.0 ** often(0.2).log10 == pytest.approx(0.25)
    assert often.quantile(0.2) == 0.3 and often.quantile(0.3) == 0.1
    assert mean_estimate([None, None], (1, 2)) is None


def test_a_run_that_is_cut_short_does_not_speak_of_equal_shares(spec):
    plan = plan_for(spec.definition, SampleRequest(n=10), Budget(30.0))
    assert all(one["share"] == 1 / 6 for one in plan.account(Tally(10, 10, 6, 60)).info["numbers"])
    assert not any("share" in one for one in plan.account(Tally(0, 7, 4, 7)).info["numbers"])


SEEN = """robot arm = panda at (0.5, -0.25, NORTH)
camera front = at (0.5, -0.6, 0.7) looks at (0.5, 0.4, 0) fov 60 deg, 4:3
object mug = cylinder(3.5 cm, 9 cm), carton = box(7 cm, 5 cm, 20 cm), bottle = cylinder(3.5 cm, 25 cm)
require noOverlap()
task: (forall p in others(arm): graspable(p, arm)) & visible(mug, front, 30 %, 70 %)
"""


@pytest.fixture(scope="module")
def seen():
    """Of robots and cameras: their problem, and rejection from the box."""
    problem = make_problem(check_text(SEEN), SampleRequest({"task": Range(0.0, None)}, n=1000))
    return problem, sampler.first_look(problem, Budget(math.inf))


def test_what_robots_and_cameras_need_is_computed_last(seen):
    problem, plan = seen
    (source,) = plan.sources
    tops = [problem.core.nodes[one.node] for stage in source.stages.stages for one in stage.conditions]
    texts = [getattr(one, "text", "") for one in tops]
    shares = [k for k, text in enumerate(texts) if "visibleShare" in text]
    cheap = [k for k, text in enumerate(texts) if text.startswith(("gap", "reachable"))]
    assert len(cheap) > 3 and min(shares, default=math.inf) > max(cheap)


def test_many_candidates_at_a_time_where_few_get_to_what_is_dear(seen):
    problem, plan = seen
    stages = plan.sources[0].stages
    assert draw_staged.chunk_size(problem, stages) > 8 * draw_staged.chunk_size(problem)
    assert plan.sources[0].candidates > 4 * draw_staged.affordable(problem, 1 << 20)
    plain = planned("task: nextTo(box[2], box[1])\n", {"task": Range(0.0, None)}, many=8)
    made = make_stages(plain, whole_box(plain))
    assert made.stages and draw_staged.chunk_size(plain, made) == draw_staged.chunk_size(plain)


def test_dear_scenes_are_the_same_with_and_without_stages(seen):
    problem, plan = seen
    (source,) = plan.sources
    rows, phi, _ = draw_kept(problem, source.cover, 8192, np.random.default_rng(3), stages=source.stages)
    others, other_phi, _ = draw_kept(problem, source.cover, 8192, np.random.default_rng(3))
    assert rows.shape[1] > 20
    np.testing.assert_array_equal(rows, others)
    np.testing.assert_array_equal(phi, other_phi)


def test_growth_counts_what_is_dear_by_its_price(seen):
    problem, _ = seen
    model = make_growth_model(problem)
    nodes = problem.core.nodes
    share = next(at for at, node in enumerate(nodes) if isinstance(node, Apply) and node.primitive == "visibleShare")
    before = model.seconds
    model.count_values(model.values("share", [share]), 1000)
    assert model.seconds - before > 1000 * SCORE_SECONDS * SHARE_WORK
    before = model.seconds
    model.count_values(model.values("top", [0]), 1000)
    assert model.seconds - before < 1e-3
