"""Where phi jumps: cells without scenes are proved empty or found out together, and the others keep their scenes."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

import scenegen
from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import gated
from scenegen.sampling.problem import Budget, Problem, make_problem
from scenegen.sampling.rejection import sampler, trial
from scenegen.sampling.rejection.trial import make_trial
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search import prune
from scenegen.search.surfaces import worlds

KITCHEN = """workspace [-0.5, 0.5] x [-0.6, 0.6]
region place = rect(-0.05, -0.25, 0, -0.2)
object stove = box(0.15, 0.15, 0.03) at (-0.3, 0.3, 0 deg)
object bowl = bowl on any of [workspace, plate]
object plate = plate on place
require apart(stove, bowl) >= 0
require apart(bowl, plate) >= 0
goal: restsOn(bowl, plate, 4 mm) & dist(bowl, plate) <= 0.03 m
"""
HOUSE = """workspace [0, 5] x [0, 4]
region board = rect(0, 0, 1.2, 0.7) at 0.75 m
object cup[2] = cup on any of [workspace, board]
require apart(cup[1], cup[2]) >= 0
goal: restsOn(cup[1], board) & restsOn(cup[2], board)
"""


TOWER = """object a = block on any of [workspace, b]
object b = block on any of [workspace, c]
object c = block
require apart(a, b) >= 0
require apart(a, c) >= 0
require apart(b, c) >= 0
goal: restsOn(a, b) | restsOn(b, c)
"""


def problem_of(text: str, low: float, high: float, n: int = 50) -> Problem:
    return make_problem(check_text(text, "test.spec"), SampleRequest(n=n, seed=0, phi={"goal": Range(low, high)}))


@pytest.mark.parametrize("text", [KITCHEN, HOUSE])
def test_each_box_has_one_choice_and_together_they_are_the_whole(text: str) -> None:
    spec = check_text(text, "test.spec")
    lowest, highest = spec.box()
    low, high = worlds(gated(spec.core), lowest, highest)
    free = highest > lowest
    sizes = ((high - low)[free] / (highest - lowest)[free, None]).prod(axis=0)
    assert low.shape[1] == (2 if text == KITCHEN else 4)
    assert sizes.sum() == pytest.approx(1.0, abs=1e-6)
    assert np.isclose(low.min(axis=1), lowest).all() and np.isclose(high.max(axis=1), highest).all()


@pytest.mark.long
@pytest.mark.parametrize("text", [KITCHEN, HOUSE])
@pytest.mark.parametrize("ends", [(-0.3, 0.0), (-0.8, 0.1), (-0.02, 0.004)])
def test_no_cell_with_scenes_is_excluded(text: str, ends: tuple[float, float]) -> None:
    spec = scenegen.parse(text)
    cells = [scenegen.sample(spec, {"goal": one}, n=2000, seed=1) for one in ((None, 0.0), (0.0, None))]
    phi = np.concatenate([one.phi["goal"] for one in cells])
    try:
        problem = problem_of(text, *ends)
    except RequestError:
        assert not ((phi >= ends[0]) & (phi <= ends[1])).any()
        return
    rows = np.stack([phi, np.ones_like(phi)])  # the second is the requirement
    hit = set(problem.cells.find(rows).tolist()) - {-1}
    assert hit <= problem.possible


@pytest.mark.long
@pytest.mark.parametrize(("high", "code"), [(-0.01, "no-such-scene"), (0.0, "too-improbable")])
def test_what_phi_jumps_over_is_refused(high: float, code: str) -> None:
    """phi is 0 where a cup stands on the very border of the board: no search finds that, but no bounds rule it out."""
    with pytest.raises(RequestError) as raised:
        problem_of(HOUSE, -0.3, high)
    assert raised.value.diagnostics[0].code == code


@pytest.mark.parametrize("side", [0.01, 1.0, 100.0])
@pytest.mark.parametrize("wide", [1e-8, 1e-9])
def test_a_tight_equality_with_a_choice_of_surfaces_has_its_scenes(side: float, wide: float) -> None:
    text = f"""workspace [0, {side}] x [0, {side}]
region board = rect(0, 0, {side / 2}, {side / 2}) at 0.4 m
object a, b = cylinder({side / 100}, 0.01) on any of [workspace, board]
goal: abs(x(a) - {0.3 * side}) <= {wide}
"""
    scenes = scenegen.sample(scenegen.parse(text), (0.0, None), n=20)
    assert len(scenes.poses) == 20 and (scenes.phi["goal"] >= 0.0).all()


def test_a_value_that_many_scenes_share_stays_possible() -> None:
    """phi is 0.001 wherever both cups are well inside the board: at the very edge of the range."""
    assert problem_of(HOUSE, -0.5, 0.001).possible == {31}


@pytest.mark.long
def test_cells_that_are_served_together_have_their_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    """The trial is told to have missed half of the cells: they are then served from one cover, with the same scenes."""
    monkeypatch.setattr(trial, "stands_of", lambda *_: ())
    problem = problem_of(KITCHEN, -0.3, -0.19, 4000)
    plain = sampler.make_plan(problem, Budget())
    first = make_trial(problem, Budget())
    hits = first.hits.copy()
    hits[10:26] = 0
    monkeypatch.setattr(sampler, "WORTH", 0.0)
    made = sampler.make_plan(problem, Budget(), dataclasses.replace(first, hits=hits))
    assert made.reachable == plain.reachable
    assert any(source.cells.sum() == 16 for source in made.sources)
    one, other = made.draw(0), plain.draw(0)
    for cell in (10, 17, 25):
        mine, its = one.rows[:, one.cell == cell], other.rows[:, other.cell == cell]
        assert min(mine.shape[1], its.shape[1]) > 50
        for row in np.flatnonzero(problem.highest > problem.lowest):
            assert stats.ks_2samp(mine[row], its[row]).pvalue > 1e-4
    assert np.array_equal(np.unique(problem.cells.find(one.phi)), np.unique(one.cell))


@pytest.mark.long
def test_a_cover_that_is_good_enough_has_the_same_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    """For a few scenes the cover is left as it is after the first split: it keeps 0.2 % of what is drawn, not 46 %."""
    monkeypatch.setattr(trial, "stands_of", lambda *_: ())  # blocks that are drawn where they stand need no splits
    few, many = (problem_of(TOWER, 0.0, 0.01, n) for n in (1, 1_000_000))
    plain = make_trial(few, Budget())
    monkeypatch.setattr(prune, "SPENT", 0.0)
    early = make_trial(few, Budget())
    assert early.cover.expected < 0.1 * plain.cover.expected and early.work < plain.work
    assert make_trial(many, Budget()).cover.expected > 0.4, "for many scenes it is worth the work"

    def drawn(cover: prune.Cover, count: int, seed: int) -> np.ndarray:
        rows = np.empty((len(few.lowest), count))
        usable, _ = cover.draw(rows, np.random.default_rng(seed))
        return rows[:, usable & (few.cells.find(few.phi(rows)) >= 0)]

    one, other = drawn(early.cover, 600_000, 1), drawn(plain.cover, 4_000, 2)
    assert min(one.shape[1], other.shape[1]) > 500
    for row in np.flatnonzero(few.highest > few.lowest):
        assert stats.ks_2samp(one[row], other[row]).pvalue > 1e-4


@pytest.mark.long
def test_cells_that_no_candidate_hits_get_no_covers_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = problem_of(KITCHEN, -0.3, -0.05)
    made: list[int] = []
    enough = trial._enough_for_cell

    def counted(of: Problem) -> tuple[float, float | None]:  # asked once for each cover of a cell
        made.append(1)
        return enough(of)

    monkeypatch.setattr(trial, "_enough_for_cell", counted)
    monkeypatch.setattr(sampler, "WORTH", 0.0)
    plan = sampler.make_plan(problem, Budget())
    assert len(plan.reachable) == 16 and not made
    monkeypatch.setattr(sampler, "WORTH", np.inf)
    assert sampler.make_plan(problem, Budget()).reachable == plan.reachable and made


@pytest.mark.parametrize("ends", [(0.0, None), (0.0, 0.0), (0.0, 0.1)])
@pytest.mark.parametrize(
    "text",
    [
        "region top = rect(0, 0, 0.5, 0.5) at 0.4 m\nobject a = block on any of [workspace, top]\ngoal: z(a) >= 0.4",
        "object a, b\ngoal: min(x(a), 0.2) >= 0.2",
    ],
)
def test_a_bound_that_many_scenes_reach_is_not_called_improbable(text: str, ends: tuple[float, float | None]) -> None:
    scenes = scenegen.sample(scenegen.parse(text), ends, n=20)
    assert (scenes.phi["goal"] == 0.0).all()
    assert "only-at-bound" not in [one.code for one in scenes.warnings]


def test_a_bound_that_single_scenes_reach_is_called_improbable() -> None:
    scenes = scenegen.sample(scenegen.parse("object a, b\ngoal: closeTo(a, b, 0)"), (0.0, None), n=20)
    assert "only-at-bound" in [one.code for one in scenes.warnings]
