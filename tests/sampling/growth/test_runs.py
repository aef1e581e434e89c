"""Growth from a request to its scenes: same bytes however it runs, held objects, deadlines, answers."""

import dataclasses
import itertools
import math
import pickle

import numpy as np
import pytest

import scenegen
from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.sampling.engine.run import in_memory
from scenegen.sampling.growth import model as model_module
from scenegen.sampling.growth.failure import late_message
from scenegen.sampling.growth.packing import packing_proof
from scenegen.sampling.growth.population import explore
from scenegen.sampling.growth.sampler import Growth, plan_growth
from scenegen.sampling.plans import make_plan
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import Budget, StoppedError

TEXT = """object p[3] = cylinder(0.06, 0.1), q = box(0.2, 0.1, 0.1)
workspace [0, 0.6] x [0, 0.6]
require noOverlap() & insideWorkspace()
task: leftOf(p[1], p[2]) & (closeTo(p[3], q, 0.3) | closeTo(p[1], q, 0.25))
"""
WORDS = {"phi": {"task": (0.0, None)}, "n": 600, "seed": 3, "method": "growth"}


@pytest.fixture(scope="module", autouse=True)
def small_populations():
    """So that a run of a few hundred scenes has several pieces."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("scenegen.sampling.growth.sampler.MIN_POPULATION", 128)
        patch.setattr("scenegen.sampling.growth.sampler.MAX_POPULATION", 256)
        patch.setattr("scenegen.sampling.growth.population.MAX_TRIED_POSES", 1 << 17)
        yield


def planned(text=TEXT, n=600, seed=3, ranges=None, seconds=600.0):
    problem = make_problem(
        check_text(text), SampleRequest({"task": Range(0.0)} if ranges is None else ranges, n=n, seed=seed)
    )
    plan = plan_growth(problem, Budget(seconds))
    assert isinstance(plan, Growth)
    return plan


@pytest.fixture(scope="module")
def plan():
    return planned()


@pytest.fixture(scope="module")
def alone():
    """Scenes of more than one piece, drawn in this process."""
    return scenegen.sample(scenegen.parse(TEXT), **WORDS, workers=1)


@pytest.mark.long
def test_the_plan_and_its_pieces_are_functions_of_the_request(plan):
    again = planned()
    assert again.plan_digest == plan.plan_digest and again.recipe.settle == plan.recipe.settle
    one, other = plan.draw(1), again.draw(1)
    assert one.rows.tobytes() == other.rows.tobytes() and one.facts.tobytes() == other.facts.tobytes()
    # a piece does not depend on those before it
    plan.draw(0)
    assert plan.draw(1).rows.tobytes() == one.rows.tobytes()
    assert planned(seed=4).plan_digest != plan.plan_digest


@pytest.mark.long
def test_a_plan_can_be_pickled(plan):
    again = pickle.loads(pickle.dumps(plan))  # noqa: S301
    assert again.plan_digest == plan.plan_digest and plan.recipe.populations == 2
    for k in range(3):
        assert again.draw(k).rows.tobytes() == plan.draw(k).rows.tobytes()
    assert not np.isin(plan.draw(0).rows[0], plan.draw(1).rows[0]).any()  # populations know nothing of each other


@pytest.mark.long
def test_no_place_is_shared_by_two_scenes(alone):
    poses = alone.poses
    for thing in range(poses.shape[1]):
        assert len(np.unique(poses[:, thing, :2], axis=0)) == len(poses)
    assert len(np.unique(poses[:, :, :2].reshape(-1, 2), axis=0)) == poses.shape[0] * poses.shape[1]


def test_scenes_meet_what_is_required(alone):
    """By numpy's own words."""
    places = alone.poses[:, :3, :2]
    for first, second in itertools.combinations(range(3), 2):
        assert np.hypot(*(places[:, first] - places[:, second]).T).min() >= 0.12 - 1e-12
    assert places.min() >= 0.06 and places.max() <= 0.54
    assert (places[:, 0, 0] <= places[:, 1, 0]).all()


@pytest.mark.long
def test_several_pieces_and_two_workers(alone):
    shared = scenegen.sample(scenegen.parse(TEXT), **WORDS, workers=2)
    assert shared.header.sampler["pieces"] >= 3
    assert shared.poses.tobytes() == alone.poses.tobytes() and shared.header == alone.header


@pytest.mark.long
def test_a_file_holds_the_same_and_resumes(alone, monkeypatch, tmp_path):
    spec, path = scenegen.parse(TEXT), tmp_path / "x.jsonl"
    scenegen.sample_to(tmp_path / "whole.jsonl", spec, **WORDS, workers=1)
    alone.save(tmp_path / "memory.jsonl")
    assert (tmp_path / "whole.jsonl").read_bytes() == (tmp_path / "memory.jsonl").read_bytes()
    done = []

    def broken(self, k, honest=Growth.draw):
        if k == 2:
            raise StoppedError
        done.append(k)
        return honest(self, k)

    with monkeypatch.context() as patch:
        patch.setattr(Growth, "draw", broken)
        with pytest.raises(RequestError, match=r"found [\d,]+ of 600 scenes") as caught:
            scenegen.sample_to(path, spec, **WORDS, workers=1)
    assert done == [0, 1] and "`resume`" in str(caught.value)
    scenegen.sample_to(path, spec, **WORDS, workers=1, resume=True)
    assert path.read_bytes() == (tmp_path / "whole.jsonl").read_bytes()


def test_held_objects_stay_and_the_others_keep_clear():
    fix = {"q": (0.25, 0.25, 0.5), "p[1]": (0.1, 0.1)}
    scenes = scenegen.sample(scenegen.parse(TEXT), {"task": (0.0, None)}, 200, method="growth", fix=fix, workers=1)
    names = list(check_text(TEXT).objects)
    held = scenes.poses[:, [names.index("q"), names.index("p[1]")]]
    assert (held[:, 0] == (0.25, 0.25, 0.5)).all() and (held[:, 1, :2] == 0.1).all()
    others = np.delete(scenes.poses, [names.index("q"), names.index("p[1]")], axis=1)
    assert np.hypot(*(others[:, :, :2] - 0.1).reshape(-1, 2).T).min() >= 0.12
    assert len(np.unique(others[:, :, 0])) == others[:, :, 0].size


def test_scenes_settle():
    text = (
        "object mug, crackerbox\nrequire noOverlap()\ntask: leftOf(mug, crackerbox) & closeTo(mug, crackerbox, 25 cm)"
    )
    words = {"phi": (0.0, None), "n": 8, "seed": 4, "method": "growth", "workers": 1}
    settled = scenegen.sample(scenegen.parse(text), **words, settle=True)
    assert len(settled) == 8 and settled.header.sampler["settled"] is True
    assert settled.header.sampler["method"] == "growth"


# ---- deadlines: the clock goes one second further at every look


class Clock:
    def __init__(self):
        self.now, self.looks = 0.0, 0

    def monotonic(self):
        self.now += 1.0
        self.looks += 1
        return self.now


@pytest.mark.long
@pytest.mark.parametrize("piece", [1, 2])
def test_a_piece_ends_when_its_time_is_up(plan, piece, monkeypatch):
    """The second piece is a population of its own, which has not been made yet here."""
    clock = Clock()
    monkeypatch.setattr("time.monotonic", clock.monotonic)
    recipe = dataclasses.replace(plan.recipe, taken=plan.recipe.taken[:1])
    short = dataclasses.replace(plan, recipe=recipe, budget=Budget(math.inf, 0.0))
    short.draw(piece)
    looks = clock.looks
    assert looks > 100  # it is looked at often
    for share in (0.01, 0.7):
        at = clock.now + share * looks
        late = dataclasses.replace(short, budget=Budget(at, 0.0))
        before = clock.looks
        with pytest.raises(StoppedError) as caught:
            late.draw(piece)
        assert clock.looks - before == pytest.approx(share * looks, abs=2)
        how_far_it_got = "all 4 objects when time was up, but were not ready" if share > 0.5 else "of 4 objects when"
        assert how_far_it_got in caught.value.how_far


@pytest.mark.parametrize("workers", [1, 2])
def test_how_far_a_piece_got_reaches_the_user_from_any_process(plan, workers):
    """The first piece is the population of the plan; time is up as soon as the second begins."""
    request = dataclasses.replace(plan.problem.request, workers=workers)
    recipe = dataclasses.replace(plan.recipe, taken=plan.recipe.taken[:1])
    problem = dataclasses.replace(plan.problem, request=request)
    short = dataclasses.replace(plan, problem=problem, recipe=recipe, budget=Budget(0.0))
    found = in_memory(short, Budget(60.0))
    assert found.shortfall is not None and 0 < found.count < 600
    assert "scenes had 0 of 4 objects when time was up" in found.shortfall.note


@pytest.mark.long
def test_what_there_was_in_time_is_kept(monkeypatch):
    def slow(self, k, honest=Growth.draw):
        if k == 2:
            raise StoppedError
        return honest(self, k)

    monkeypatch.setattr(Growth, "draw", slow)
    with pytest.raises(RequestError, match="of 600 scenes"):
        scenegen.sample(scenegen.parse(TEXT), **WORDS, workers=1)
    scenes = scenegen.sample(scenegen.parse(TEXT), **WORDS, workers=1, keep_partial=True)
    assert 200 < len(scenes) <= 400 and scenes.warnings[-1].title.endswith("; these are kept")


def test_planning_ends_when_its_time_is_up():
    problem = make_problem(check_text(TEXT), SampleRequest({"task": Range(0.0)}, n=10))
    with pytest.raises(RequestError) as caught:
        make_plan(problem, Budget(1e-6), method="growth")
    assert "time was up" in str(caught.value)


# ---- too full, or impossible

FULL = """workspace [0, 0.3] x [0, 0.2]
object coin[7] = box(0.09, 0.09, 0.01)
require noOverlap() & insideWorkspace()
task: leftOf(coin[1], coin[2])
"""
# d is 30 cm from a at most, and 31 are asked for, askew: no bounds along x and y alone prove that
REFUSED = """object a, b, c, d
task: closeTo(a, b, 0.1) & closeTo(b, c, 0.1) & closeTo(c, d, 0.1)
ends: leftOf(a, d) & belowOf(a, d)
"""


def said(text, ranges):
    problem = make_problem(check_text(text), SampleRequest(ranges, n=10))
    with pytest.raises(RequestError) as caught:
        make_plan(problem, Budget(600.0), method="growth")
    return f"{caught.value}\n"


@pytest.mark.long
def test_a_table_that_is_too_full(golden):
    """Six boxes of 9 cm take nearly all of 30 x 20 cm; the seventh has no room."""
    text = said(FULL, {"task": Range(0.0)})
    assert "could be placed" in text and "clear" in text
    golden("sampling/growth/too_full.txt", text)


def test_a_clause_that_refuses_every_pose(golden):
    golden("sampling/growth/refused.txt", said(REFUSED, {"task": Range(0.0), "ends": Range(0.22)}))


# in a disc of 11 cm no three points are more than 19.1 cm from each other
AFAR = """object p[5] = cylinder(0.02, 0.01), post[3] = cylinder(0.01, 0.1)
require noOverlap()
task: (forall a in post: closeTo(a, (0.5, 0.5), 11 cm)) & (forall a, b in post: farFrom(a, b, 20 cm))
"""


@pytest.mark.long
def test_a_distance_that_refuses_is_named_not_the_footprints():
    text = said(AFAR, {"task": Range(0.0)})
    assert "farFrom(" in text and "use fewer or smaller objects" not in text
    assert "7 of 8 objects could be placed" in text  # also those that come after the one without room


def test_time_that_is_up_while_scenes_grow_says_how_far_they_are():
    problem = make_problem(check_text(FULL), SampleRequest({"task": Range(0.0)}, n=10))
    model = model_module.make_growth_model(problem)
    model.furthest = 5
    assert "5 of 7 objects could be placed" in str(late_message(model, "9 evaluations"))
    model.furthest = 7
    assert "all 7 objects could be placed" in str(late_message(model, "9 evaluations"))


@pytest.mark.long
@pytest.mark.parametrize(("text", "proved"), [
    (FULL.replace("box(0.09, 0.09", "cylinder(0.05"), "7 objects (`coin[1]` to `coin[7]`) must be 10 cm apart"),
    (FULL.replace("coin[7] = box(0.09, 0.09", "coin[6] = cylinder(0.05"), ""),
    ("object p[9] = cylinder(0.01, 0.1)\nregion tray = rect(0.2, 0.2, 0.5, 0.5)\n"
     "task: (forall a, b in p: farFrom(a, b, 18 cm)) & (forall a in p: inside(a, tray))", "18 cm apart"),
    ("object p[9] = cylinder(0.01, 0.1)\nregion tray = rect(0.2, 0.2, 0.5, 0.5)\n"
     "task: (forall a, b in p: farFrom(a, b, 14 cm)) & (forall a in p: inside(a, tray))", ""),
    ("object p[5] = box(0.2, 0.2, 0.1)\nworkspace [0, 0.4] x [0, 0.4]\nrequire noOverlap()\n"
     "task: leftOf(p[1], p[2])", ""),
    ("object p[25] = box(0.5, 0.1, 0.1)\nworkspace [0, 0.4] x [0, 0.4]\nrequire noOverlap()\n"
     "task: leftOf(p[1], p[2])", "take 12500 cm2"),
    ("object tray, p[12] = mug on tray\nrequire noCollision()\ntask: leftOf(p[1], p[2])",
     "12.4 cm apart, on `tray.inside`: no more than 7"),
    ("object shelfunit\nobject p[40] = book on shelfunit.shelf[1]\nrequire insideWorkspace()\ntask: noCollision(p)",
     "on `shelfunit.shelf[1]`: no more than 7"),
    ("object board = box(40 cm, 10 cm, 1 cm), p[14] = box(30 cm, 8 cm, 1 cm) on board\ntask: noOverlap(p)",
     "on and around `board.top`"),  # their centres are on it, they may reach over its edge
    ("object board = box(40 cm, 10 cm, 1 cm), p[4] = box(30 cm, 8 cm, 1 cm) on board\ntask: noOverlap(p)", ""),
    ("object tray[2], p[16] = mug on any of [tray[1], tray[2]]\nrequire noCollision()\ntask: leftOf(p[1], p[2])",
     "on `tray[1].inside` and `tray[2].inside`: no more than 14"),
    ("object tray[2], p[16] = mug on any of [tray[1], tray[2]]\nrequire noCollision() | leftOf(p[1], p[2])\n"
     "task: leftOf(p[1], p[2])", ""),
    ("object tray[2], p[16] = mug on any of [tray[1], workspace]\nrequire noCollision()\ntask: leftOf(p[1], p[2])", ""),
    ("object tray, p[40] = mug on tray\ntask: leftOf(p[1], p[2])", ""),  # they may overlap
])  # fmt: skip
def test_tables_that_areas_prove_too_full(text, proved):
    problem = make_problem(check_text(text), SampleRequest({"task": Range(0.0)}, n=10))
    proof = packing_proof(model_module.make_growth_model(problem).graph, problem.spec)
    assert (proved in proof["proof"]) if proved else not proof
    if proved:
        answer = said(text, {"task": Range(0.0)})
        assert answer.startswith("error[table-too-full]") and "more time" not in answer
        assert proof.get("surfaces", "the table") in answer


def test_a_request_that_nothing_is_left_to_evaluate_of():
    """Nearly all scenes are violated: growth draws them, and to move them takes no work that could be divided by."""
    text = "object a[3]\ntask: forall p, q in a: dist(p, q) <= 1e-12\n"
    found = scenegen.sample(scenegen.parse(text), {"task": (None, 0.0)}, n=50, method="growth", workers=1)
    assert len(found) == 50 and found.phi["task"].max() < 0.0
    assert found.header.sampler["candidates"] == 0 and found.header.sampler["log10_probability"] == 0.0


def test_the_first_size_is_left_out_where_it_is_known_to_be_too_small(monkeypatch):
    tried = []

    def explored(model, cell, island, *rest, **named):
        tried.append(len(cell))
        return explore(model, cell, island, *rest, **named)

    monkeypatch.setattr("scenegen.sampling.growth.population.explore", explored)
    problem = make_problem(check_text(TEXT), SampleRequest({"task": Range(0.0)}, n=20, seed=3))
    assert isinstance(plan_growth(problem, Budget()), Growth)
    assert isinstance(plan_growth(problem, Budget(), larger=True), Growth)
    assert tried == [128, 256]
