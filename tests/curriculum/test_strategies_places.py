"""Difficulty, levels and cells; the mixtures against scikit-learn's; what is said of bad requests."""

import numpy as np
import pytest

from scenegen.errors import RequestError
from scenegen.learn.curriculum.strategies import strategy
from scenegen.learn.curriculum.strategies.alp_gmm import fit
from scenegen.learn.curriculum.strategies.base import DifficultyAxis, DifficultyGrid, Levels, drawn, pick
from scenegen.learn.curriculum.tasks import Outcome, PhiBox

from .learners import draw, reach

SPACES = [
    PhiBox((-0.7,), (0.1,)),
    PhiBox((-1.3, -0.2), (-0.01, 0.4)),
    PhiBox((-1.0, 0.25, -3.0), (0.0, 0.25, 0.0)),
    PhiBox((-1.0, -1.0, -3.0), (0.0, 0.5, 0.0)),
]


def boxes(parts):
    return [box for box, _ in sorted(parts._named.items(), key=lambda pair: pair[1])]


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("kind", [Levels, DifficultyGrid])
def test_parts_fill_the_space_and_do_not_overlap(space, kind):
    parts, rng = kind(DifficultyAxis(space), 4), np.random.default_rng(0)
    for _ in range(300):
        phi = draw(space, rng)
        mine = [parts._named[box] for box in boxes(parts) if box.holds(phi)]
        assert len(mine) == 1
        assert parts.of(Outcome(space, phi, True, 0.0, 1)) == mine[0]


@pytest.mark.parametrize("space", SPACES)
def test_an_outcome_belongs_to_the_level_that_was_asked_for(space):
    levels, rng = Levels(DifficultyAxis(space), 3), np.random.default_rng(0)
    for level in range(3):
        for _ in range(10):
            task = levels.box(level, rng)
            assert levels.of(Outcome(task, draw(task, rng), True, 0.0, 1)) == level
            assert levels.of(Outcome(task, draw(space, rng), True, 0.0, 1)) == level  # a source that had none


@pytest.mark.parametrize("space", SPACES)
def test_an_outcome_belongs_to_the_cell_that_its_scene_lay_in(space):
    cells, rng = DifficultyGrid(DifficultyAxis(space), 3), np.random.default_rng(0)
    for cell in range(cells.count):
        task = cells.box(cell)
        for phi in (draw(task, rng), task.low, task.high):  # faces, too, belong to the box that was asked for
            assert cells.of(Outcome(task, phi, True, 0.0, 1)) == cell
        other = cells.box((cell + 1) % cells.count)
        assert cells.of(Outcome(task, draw(other, rng), True, 0.0, 1)) == (cell + 1) % cells.count


def test_cells_without_scenes_are_closed_after_three_attempts_and_opened_by_a_scene():
    cells, rng = DifficultyGrid(DifficultyAxis(reach()), 4), np.random.default_rng(0)
    for cell, times in [(3, 3), (2, 2), (1, 5)]:
        for _ in range(times):
            cells.of(Outcome(cells.box(cell), (-0.1,), True, 0.0, 1))
    assert cells.open.tolist() == [1, 0, 1, 0]
    assert {cells.any(rng) for _ in range(50)} == {0, 2}
    assert cells.of(Outcome(reach(), (-0.9,), True, 0.0, 1)) == 3
    for _ in range(5):  # it has scenes, whatever the source says later
        cells.of(Outcome(cells.box(3), (-0.1,), True, 0.0, 1))
    assert cells.open.tolist() == [1, 0, 1, 1]


def test_the_last_cell_is_never_closed():
    cells, rng = DifficultyGrid(DifficultyAxis(reach()), 2), np.random.default_rng(0)
    for _ in range(5):
        for cell in range(2):
            assert cells.of(Outcome(cells.box(cell), (9.0,), True, 0.0, 1)) is None
    assert cells.open.sum() == 1
    assert cells.open[cells.any(rng)] == 1.0


def test_levels_are_difficulties():
    axis, rng = DifficultyAxis(SPACES[1]), np.random.default_rng(0)
    assert axis.difficulty(axis.space.high) == 0.0
    assert axis.difficulty(axis.space.low) == 1.0
    assert axis.difficulty((-0.01, 0.1)) == pytest.approx(0.5)  # one label at its best, the other half way
    assert axis.difficulty((0.0, 0.1)) is None and axis.difficulty((float("nan"), 0.1)) is None
    for near, far in [(0.0, 0.3), (0.25, 0.5), (0.9, 1.0)]:
        found = [axis.difficulty(draw(pick(axis.shell(near, far), rng), rng)) for _ in range(100)]
        assert near - 1e-9 <= min(found) and max(found) <= far + 1e-9


def test_scenes_of_a_shell_are_spread_evenly():
    """Of two labels, in the difficulties from 0.5 to 1, a third each: first label alone, second alone, both far."""
    axis, rng = DifficultyAxis(reach(2)), np.random.default_rng(0)
    far = np.array([draw(pick(axis.shell(0.5, 1.0), rng), rng) for _ in range(3000)]) < -0.5
    shares = [np.mean(far[:, 0] & ~far[:, 1]), np.mean(far[:, 1] & ~far[:, 0]), np.mean(far.all(1))]
    assert shares == pytest.approx([1 / 3] * 3, abs=0.03)


def test_the_ends_of_the_reach_are_met_exactly():
    """However awkward the numbers: the hardest scene is in the last level, the easiest in the first."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        low, high = sorted(rng.normal(size=2).tolist())
        levels = Levels(DifficultyAxis(PhiBox((low,), (high,))), 7)
        assert levels.box(6, rng).low == (low,) and levels.box(0, rng).high == (high,)


def test_draws_follow_their_weights():
    rng, weights = np.random.default_rng(0), np.array([0.0, 1.0, 3.0, 0.0])
    counts = np.bincount([drawn(weights, rng) for _ in range(4000)], minlength=4)
    assert counts[0] == counts[3] == 0 and counts[2] / counts[1] == pytest.approx(3.0, rel=0.15)


@pytest.mark.long
@pytest.mark.parametrize("width", [1, 2, 4])
def test_mixtures_are_as_likely_as_those_of_scikit_learn(width):
    rng = np.random.default_rng(width)
    middles = np.array([[0.1] * width, [0.5] * width, [0.9] * width])
    points = np.concatenate([rng.normal(middle, 0.04, (80, width)) for middle in middles])
    found = fit(points, 5, rng, rounds=30)
    from sklearn.mixture import GaussianMixture  # a second of imports, which the other tests need not take

    theirs = GaussianMixture(len(found.weights), n_init=5, random_state=0).fit(points).score(points)
    apart = points[:, None] - found.means
    far = np.einsum("nkd,kde,nke->nk", apart, np.linalg.inv(found.covariances), apart)
    density = found.weights * np.exp(-far / 2) / np.sqrt(np.linalg.det(2 * np.pi * found.covariances))
    assert np.log(density.sum(1)).mean() > theirs - 0.15
    assert found.weights.sum() == pytest.approx(1.0)
    for middle in middles:
        assert np.abs(found.means - middle).max(1).min() < 0.05


@pytest.mark.parametrize("points", [np.zeros((1, 2)), np.zeros((50, 2)), np.ones((3, 3)), np.eye(4)])
def test_mixtures_of_few_or_equal_points_are_finite(points):
    found = fit(points, 4, np.random.default_rng(0))
    assert all(np.isfinite(part).all() for part in (found.weights, found.means, found.covariances))


BAD = [
    ("selfpaced", reach(), {}),
    ("curious", reach(), {}),
    ("self_paced", reach(), {"bands": 3}),
    ("self_paced", reach(), {"colour": "red"}),
    ("self_paced", reach(), {"band": 1}),
    ("self_paced", reach(), {"rate": float("nan")}),
    ("linear", reach(), {"episodes": "many"}),
    ("reverse", reach(), {"low": 0.9, "high": 0.1}),
    ("reverse", reach(), {"replay": 0.7, "share": 0.7}),
    ("uniform", reach(2), {"labels": [2]}),
    ("uniform", reach(2), {"labels": []}),
    ("uniform", PhiBox((0.0,), (-1.0,)), {}),
    ("uniform", PhiBox((float("-inf"),), (0.0,)), {}),
    ("uniform", PhiBox((-1.0, -1.0), (0.0,)), {}),
    ("uniform", PhiBox((), ()), {}),
    ("teacher", reach(13), {}),
]


def test_bad_requests(golden):
    lines = []
    for name, space, settings in BAD:
        with pytest.raises(RequestError) as caught:
            strategy(name, space, np.random.default_rng(0), **settings)
        lines += [f"== {name} {space.low} {space.high} {settings}", str(caught.value), ""]
    golden("curriculum/bad_strategies.txt", "\n".join(lines))


@pytest.mark.parametrize(
    "name, space, rng, text",
    [
        (["linear"], PhiBox((-1.0,), (0.0,)), np.random.default_rng(0), "unknown strategy"),
        ("linear", None, np.random.default_rng(0), "None is no reach of phi"),
        ("linear", PhiBox(-1.0, 0.0), np.random.default_rng(0), "is no reach of phi"),
        ("linear", PhiBox(("a",), ("b",)), np.random.default_rng(0), "is no reach of phi"),
        ("linear", PhiBox((-1.0,), (0.0,)), 0, "`rng` is 0"),
    ],
)
def test_what_is_of_another_type(name, space, rng, text):
    with pytest.raises(RequestError, match=text):
        strategy(name, space, rng)
