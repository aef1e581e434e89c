"""`--spread even`: every choice is the farthest of what is left, cells and numbers of things keep their shares, and the
same bytes come from any number of workers."""

import itertools
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import scenegen
from scenegen.api.request import check_request
from scenegen.api.scene_arrays import as_rows
from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.sampling.engine.run import in_memory
from scenegen.sampling.even import farthest
from scenegen.sampling.plan import Selection
from scenegen.sampling.plans import plan_for
from scenegen.sampling.request import EVEN_CANDIDATES, MAX_EVEN, Range, SampleRequest
from scenegen.scenes.coverage import features
from scenegen.search.effort import Budget, StoppedError

TEXT = "object mug, plate, cup\ntask: leftOf(mug, plate) & closeTo(cup, mug, 0.3)\n"
NUMBERS = "object block[2: 1, 3: 2, 5: 1], mug\ntask: exists b in block: leftOf(b, mug)\n"
MOTION = "time 4 steps\nobject mug, plate\ntask: always leftOf(mug, plate)\n"


def points_of(seed, count, width=3):
    return np.random.default_rng(seed).random((count, width))


def distances(points):
    return np.linalg.norm(points[:, None] - points[None], axis=2)


def assert_farthest(points, cell, shares, chosen):
    """By brute force: among the cells that lack scenes, none is farther from all that are chosen before."""
    apart, left = distances(points), dict(shares)
    for turn, one in enumerate(chosen):
        before = chosen[:turn]
        free = [k for k in range(len(points)) if left.get(cell[k], 0) and k not in before]
        assert one in free
        if turn:
            assert apart[one, before].min() >= max(apart[k, before].min() for k in free) - 1e-7
        else:
            assert one == free[0]
        left[cell[one]] -= 1
    assert all(not left[cell[k]] for k in range(len(points)) if left.get(cell[k]) and k not in chosen)


@given(st.integers(0, 2**32), st.integers(1, 40), st.lists(st.integers(0, 5), min_size=1, max_size=4))
def test_each_choice_is_the_farthest(seed, count, each):
    points = points_of(seed, count)
    cell = np.random.default_rng(seed + 1).integers(0, len(each) + 1, count)  # one cell has no share at all
    shares = dict(enumerate(each))
    chosen = farthest(points, cell, shares).tolist()
    assert len({*chosen}) == len(chosen)
    for one, share in shares.items():
        assert (cell[chosen] == one).sum() == min(share, (cell == one).sum())
    assert_farthest(points, cell, shares, chosen)


@given(st.integers(0, 2**32), st.integers(2, 5), st.integers(5, 9))
def test_no_choice_is_more_than_twice_as_far(seed, n, count):
    points = points_of(seed, count, 2)
    apart = distances(points) + np.diag(np.full(count, np.inf))
    best = max(apart[np.ix_(some, some)].min() for some in map(list, itertools.combinations(range(count), n)))
    chosen = farthest(points, np.zeros(count, dtype=np.intp), {0: n})
    assert 2.0 * apart[np.ix_(chosen, chosen)].min() >= best - 1e-7


def test_equal_scenes_are_chosen_last():
    points = np.repeat(points_of(0, 3), 2, axis=0)
    chosen = farthest(points, np.zeros(6, dtype=np.intp), {0: 5})
    assert {one // 2 for one in chosen[:3].tolist()} == {0, 1, 2} and len({*chosen.tolist()}) == 5


def planned(text, request, seconds=60.0):
    return plan_for(check_text(text, "a.spec"), request, Budget(seconds))


@pytest.mark.parametrize(
    "ends, n", [((0.0, 0.25), 20), pytest.param((0.0, 0.25), 70, marks=pytest.mark.long), ((0.0, None), 30)]
)
def test_a_plan_chooses_among_its_candidates(ends, n):
    request = SampleRequest({"task": Range(*ends)}, n, seed=4, spread="even")
    plan = planned(TEXT, request)
    made = plan.draw(0)
    candidates = in_memory(plan.plan, Budget())
    assert candidates.count == EVEN_CANDIDATES * n and made.rows.shape[1] == n
    found = [int(np.flatnonzero((candidates.rows == one[:, None]).all(axis=0))[0]) for one in made.rows.T]
    cell = plan.cells.find(candidates.phi)
    shares = np.bincount(made.cell, minlength=plan.cells.count)
    assert_farthest(features(candidates.rows), cell, dict(enumerate(shares.tolist())), found)
    # as many of each cell as `flat` has
    flat = in_memory(planned(TEXT, SampleRequest({"task": Range(*ends)}, n, seed=4)), Budget())
    assert (np.bincount(plan.cells.find(flat.phi), minlength=plan.cells.count) == shares).all()


@pytest.mark.long
@pytest.mark.parametrize("text, ends", [(TEXT, (0.0, 0.25)), (TEXT, (0.0, None)), (NUMBERS, (0.0, 0.2))])
def test_workers_and_formats_change_nothing(text, ends, tmp_path):
    spec, words = scenegen.parse(text), {"phi": {"task": ends}, "n": 40, "seed": 2, "spread": "even"}
    alone = scenegen.sample(spec, **words, workers=1)
    assert len(alone) == 40 and alone.header.request.spread == "even" and alone.header.sampler["cells"]
    alone.save(tmp_path / "alone.parquet")
    scenegen.sample_to(tmp_path / "shared.parquet", spec, **words, workers=2, resume=True)
    scenegen.sample_to(f"{tmp_path}/one/", spec, **words, workers=1)
    scenegen.sample_to(f"{tmp_path}/two/", spec, **words, workers=2)
    assert (tmp_path / "alone.parquet").read_bytes() == (tmp_path / "shared.parquet").read_bytes()
    names = [path.name for path in sorted((tmp_path / "one").glob("*.parquet"))]
    assert names
    for name in names:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_scenes_are_farther_from_each_other_than_flat_ones():
    """The smallest distance was 1.5 to 2.6 times as large for seeds 0 to 9."""
    spec = scenegen.parse(TEXT)
    smallest = {}
    for spread in ("flat", "even"):
        scenes = scenegen.sample(spec, {"task": (0.0, 0.25)}, 60, seed=1, spread=spread, workers=1)
        apart = distances(features(as_rows(scenes.poses))) + np.diag(np.full(60, np.inf))
        smallest[spread] = apart.min()
    assert smallest["even"] > 1.25 * smallest["flat"]


def test_numbers_of_things_keep_their_weights():
    plan = planned(NUMBERS, SampleRequest({"task": Range(0.0, 0.2)}, 40, spread="even"))
    drawn = in_memory(plan, Budget())
    there = (~np.isnan(drawn.rows[::3])).sum(axis=0) - 1  # without the mug
    assert dict(zip(*np.unique(there, return_counts=True), strict=True)) == {2: 10, 3: 20, 5: 10}
    assert drawn.info["chosen_from"] == 16 * 40
    assert [part["share"] for part in drawn.info["numbers"]] == [0.25, 0.5, 0.25]


def test_of_too_little_time_it_is_said_how_far_it_came():
    plan = planned(TEXT, SampleRequest({"task": Range(0.0, 0.25)}, 4000, spread="even"))
    hurried = replace(plan, budget=Budget(0.0))
    with pytest.raises(StoppedError, match="of the 64,000 to choose from were there"):
        hurried.draw(0)
    drawn = in_memory(hurried, Budget(60.0))
    assert drawn.count == 0 and drawn.shortfall is not None
    assert "in the time that there was" in drawn.shortfall.title


@dataclass(frozen=True, slots=True, eq=False)
class Poor(Selection):
    """A plan that never hits cell 3, and gives up after two pieces without a new scene."""

    plan_digest: ClassVar[str] = "poor"
    fact_count: ClassVar[int] = 0
    patience: ClassVar[int] = 2

    def draw(self, k):
        piece = self.plan.draw(k)
        return replace(piece, cell=np.where(piece.cell == 3, -1, piece.cell))

    def account(self, tally):
        return self.plan.account(tally)


def test_where_a_cell_has_too_few_the_run_ends():
    plan = planned(TEXT, SampleRequest({"task": Range(0.0, 0.25)}, 64, spread="even"))
    drawn = in_memory(replace(plan, plan=Poor(plan.plan.problem, plan.plan)), Budget(60.0))
    assert drawn.count == 62 and drawn.shortfall is not None
    assert "found 62 of 64 scenes in" in drawn.shortfall.title and "draws" in drawn.shortfall.title


@pytest.mark.parametrize(
    "text, changes, words",
    [
        (TEXT, {"n": MAX_EVEN + 1}, "4,097"),
        (MOTION, {}, "these are motions"),
    ],
)
def test_what_even_cannot_do_is_refused(text, changes, words):
    with pytest.raises(RequestError, match=words) as caught:
        check_request(scenegen.parse(text), SampleRequest(**{"spread": "even", **changes}))
    assert len(caught.value.diagnostics) == 1


@pytest.mark.long
def test_models_are_refused():
    with pytest.raises(RequestError, match="a model's are not"):
        scenegen.sample(scenegen.parse(TEXT), {"task": (0.0, 0.1)}, method="any", spread="even")


def test_given_scenes_are_not_chosen_from():
    with pytest.raises(RequestError, match="completed once"):
        scenegen.sample(scenegen.parse(TEXT), {"task": (0.0, None)}, spread="even", fix={"mug": np.zeros((3, 2)) + 0.5})
