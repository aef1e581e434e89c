"""Scenes of specs with priors, against priors drawn by hand with scipy and plain rejection: by every exact method, with
things held, given and moved, with drawn numbers of things; their probability; the same bytes whoever draws them.
"""

import math
import re

import numpy as np
import pytest
from scipy import stats

import scenegen
from scenegen.api.scene_arrays import rows_of
from scenegen.errors import RequestError
from scenegen.learn.training.dataset import base_draw
from scenegen.sampling.prior import pull_back

SPEC = """object mug, saucer, plate
region corner = polygon([(0.5, 0.1), (0.9, 0.1), (0.9, 0.7)])
usually mug ~ normal((0.4, 0.9), 20 cm)
usually saucer ~ normal(mug, 10 cm)
usually theta(mug) ~ normal(NORTH, 40 deg)
usually plate ~ [uniform(corner): 3, normal((0.1, 0.1), 8 cm): 1]
task: leftOf(mug, plate) & !closeTo(saucer, plate, 0.3)
"""
LOW, HIGH = 0.05, 0.3


def cut_off(middle, deviation, rng, count):
    ends = (0.0 - middle) / deviation, (1.0 - middle) / deviation
    return stats.truncnorm.rvs(*ends, loc=middle, scale=deviation, size=count, random_state=rng)


def by_hand(rng, count):
    """(9, count): the prior of SPEC, its phi not looked at."""
    rows = rng.random((9, count))
    rows[2::3] *= math.tau
    rows[0], rows[1] = cut_off(0.4, 0.2, rng, count), cut_off(0.9, 0.2, rng, count)
    rows[2] = math.pi / 2 + stats.truncnorm.rvs(-4.5, 4.5, scale=math.radians(40), size=count, random_state=rng)
    rows[3], rows[4] = cut_off(rows[0], 0.1, rng, count), cut_off(rows[1], 0.1, rng, count)
    u, v = rng.random((2, count))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    near = rng.random(count) < 0.25
    rows[6] = np.where(near, cut_off(0.1, 0.08, rng, count), 0.5 + 0.4 * u + 0.4 * v)
    rows[7] = np.where(near, cut_off(0.1, 0.08, rng, count), 0.1 + 0.6 * v)
    rows[2::3] %= math.tau
    return rows


def phi_by_hand(rows):
    apart = np.hypot(rows[3] - rows[6], rows[4] - rows[7])
    return np.minimum(rows[6] - rows[0], apart - 0.3)


@pytest.mark.parametrize("method", ["auto", "growth", "splitting"])
def test_what_no_number_can_tell_apart_is_refused(method):
    spec = scenegen.parse(
        "object mug, plate\nusually mug ~ normal((0.1, 0.5), 10 cm)\nrequire x(mug) >= 0.85\ntask: leftOf(plate, mug)"
    )
    with pytest.raises(RequestError, match="less than 1e-12 of its distribution") as caught:
        scenegen.sample(spec, {"task": (0.0, None)}, 10, method=method)
    assert caught.value.diagnostics[0].code == "too-improbable"


@pytest.mark.parametrize("method", ["auto", "growth"])
def test_cells_that_numbers_cannot_tell_apart_have_no_scenes(method):
    spec = scenegen.parse(
        "object plate at (0, 0.5, 0), mug\nusually mug ~ normal((0.1, 0.5), 8 cm)\ntask: leftOf(plate, mug)"
    )
    made = scenegen.sample(spec, {"task": (0.0, 1.0)}, 640, method=method, workers=1)
    x = made.poses[:, 1, 0]
    assert len(np.unique(x)) == len(x) and 0.6 < x.max() < 0.68  # 7 deviations away, or the end of that cell
    assert "cells of the range were not reached" in made.warnings[0].title


@pytest.fixture(scope="module")
def truth():
    rows = by_hand(np.random.default_rng(5), 400_000)
    phi = phi_by_hand(rows)
    inside = (phi >= LOW) & (phi <= HIGH)
    return rows[:, inside], math.log10(inside.mean())


def worst(one, other):
    """The largest Kolmogorov-Smirnov distance of coordinates and of directions through them."""
    rng = np.random.default_rng(0)
    axes = np.concatenate([np.eye(len(one)), rng.normal(size=(10, len(one)))])
    return max(stats.ks_2samp(axis @ one, axis @ other).statistic for axis in axes)


def drawn(spec, count, **options):
    return rows_of(spec.checked, scenegen.sample(spec, (LOW, HIGH), count, spread="base", timeout=120, **options))


@pytest.mark.long
@pytest.mark.parametrize("method", ["rejection", "growth", "splitting"])
def test_scenes_follow_the_prior(method, truth):
    expected, log10 = truth
    spec = scenegen.parse(SPEC)
    scenes = scenegen.sample(spec, (LOW, HIGH), 4000, spread="base", method=method, timeout=120)
    rows, info = rows_of(spec.checked, scenes), scenes.header.sampler
    assert worst(rows, expected) < 0.035  # 4,000 against 100,000: 0.026 at p = 0.01 of one, for 19 directions
    assert info["log10_probability"] == pytest.approx(log10, abs=4.0 * info["log10_error"] + 0.01)
    assert np.abs(phi_by_hand(rows) - scenes.phi["task"]).max() < 1e-9


def test_training_draws_from_the_prior():
    torch = pytest.importorskip("torch")
    rows = base_draw(scenegen.parse(SPEC).checked, 8000, torch.Generator().manual_seed(1)).numpy()
    assert worst(rows, by_hand(np.random.default_rng(6), 40_000)) < 0.025


@pytest.mark.long
def test_what_is_held_stays_and_what_is_relative_to_it_follows():
    spec = scenegen.parse(SPEC)
    rows = drawn(spec, 2000, fix={"mug": (0.3, 0.8, 1.0)})
    assert (rows[:3] == np.array([[0.3], [0.8], [1.0]])).all()
    rng = np.random.default_rng(7)
    expected = by_hand(rng, 200_000)
    expected[:3] = [[0.3], [0.8], [1.0]]
    expected[3], expected[4] = cut_off(0.3, 0.1, rng, 200_000), cut_off(0.8, 0.1, rng, 200_000)
    phi = phi_by_hand(expected)
    expected = expected[:, (phi >= LOW) & (phi <= HIGH)]
    assert worst(rows[3:], expected[3:]) < 0.05
    given = np.full((2000, 3, 3), np.nan)
    given[:, 0] = 0.3, 0.8, 1.0
    completed = rows_of(spec.checked, scenegen.sample(spec, (LOW, HIGH), fix=given, spread="base"))
    assert worst(completed[3:], expected[3:]) < 0.05


def test_what_would_turn_a_prior_round_is_refused():
    spec = scenegen.parse(SPEC)
    given = np.full((4, 3, 3), np.nan)
    given[2, 1] = 0.3, 0.8, 1.0
    for fix in ({"saucer": (0.3, 0.8)}, given):
        with pytest.raises(RequestError, match="`saucer` cannot be held while `mug` is free"):
            scenegen.sample(spec, (LOW, HIGH), fix=fix)
    for pose, free in (((0.3, 0.3), "theta(mug)"), ((0.3, 0.3, 1.0), "saucer")):
        with pytest.raises(RequestError, match=f"`mug` cannot be held while `{re.escape(free)}` is free"):
            scenegen.sample(scenegen.parse(RECORDS), (0.0, 0.5), fix={"mug": pose})
    rows = drawn(spec, 20, fix={"saucer": (0.3, 0.8), "mug": (0.2, 0.8)})
    assert (rows[[0, 1, 3, 4]] == np.array([[0.2], [0.8], [0.3], [0.8]])).all()


RECORDS = """object mug, saucer
usually mug, saucer ~ poses([[(0.2, 0.2, 0), (0.3, 0.2, 10 deg)], [(0.7, 0.6, 90 deg), (0.99, 0.6, 0)]], 4 cm, 20 deg)
task: leftOf(mug, saucer)
"""


def test_recorded_rows_stay_together():
    rows = rows_of((spec := scenegen.parse(RECORDS)).checked, scenegen.sample(spec, {}, 4000, spread="base"))
    first = rows[0] < 0.5
    assert abs(first.mean() - 0.5) < 0.03
    assert (rows[3][first] < 0.5).all() and (rows[3][~first] > 0.9).all()
    for values, low, high in ((rows[0][first], 0.16, 0.24), (rows[3][~first], 0.95, 1.0), (rows[4], 0.16, 0.24)):
        mine = values[values < 0.5] if high < 0.5 else values
        assert stats.kstest(mine, "uniform", (low, high - low)).pvalue > 1e-3
    turned = (rows[2][first] + math.pi) % math.tau - math.pi
    assert stats.kstest(turned, "uniform", (-math.radians(20), math.radians(40))).pvalue > 1e-3


def test_many_rows_are_drawn_equally_often():
    places = [(0.05 + 0.09 * (k % 10), 0.05 + 0.09 * (k // 10)) for k in range(100)]
    literal = ", ".join(f"({x:.2f}, {y:.2f}, 0)" for x, y in places)
    spec = scenegen.parse(f"object mug\nusually mug ~ poses([{literal}], 2 cm, 5 deg)\ntask: x(mug) <= 2 m\n")
    for method in ("rejection", "growth"):
        rows = rows_of(spec.checked, scenegen.sample(spec, (1.2, 2.0), 5000, spread="base", method=method))
        x, y = ((row - 0.05) / 0.09 for row in rows[:2])
        counts = np.bincount((np.rint(y) * 10 + np.rint(x)).astype(int), minlength=100)
        wanted = np.array([place[0] <= 0.8 for place in places])
        sure = np.array([place[0] < 0.77 for place in places])
        assert not counts[~wanted].any()
        assert stats.chisquare(counts[sure]).pvalue > 1e-3


def test_priors_of_drawn_numbers_and_choices():
    text = """region shelf = rect(0.1, 0.8, 0.9, 0.95) at 30 cm
object block[1..3], can on any of [shelf: 1, workspace: 1]
usually block ~ normal((0.3, 0.4), 4 cm)
usually can ~ normal((0.5, 0.85), 10 cm)
task: forall b in block: closeTo(b, can, 1 m)
"""
    spec = scenegen.parse(text)
    scenes = scenegen.sample(spec, {}, 1500, spread="base")
    blocks = np.concatenate(
        [scenes.poses[:, k, :2] for k, name in enumerate(scenes.objects) if name.startswith("block")]
    )
    blocks = blocks[~np.isnan(blocks[:, 0])]
    assert len(blocks) == 3000  # 1, 2 and 3 equally often
    assert stats.kstest((blocks[:, 0] - 0.3) / 0.04, "norm").pvalue > 1e-3
    assert stats.kstest((blocks[:, 1] - 0.4) / 0.04, "norm").pvalue > 1e-3


def test_objects_that_move_between_start_and_goal_go_where_they_usually_are():
    found = scenegen.pairs(scenegen.parse(SPEC), (0.0, 0.3), n=300, moved=1, seed=2)
    start, goal = found.poses[:, 0], found.poses[:, 1]
    moved = (start != goal).any(axis=2)
    assert (moved.sum(axis=1) == 1).all()
    headings = start[moved[:, 0], 0, 2]
    assert abs(np.mean(np.cos(headings - math.pi / 2))) > 0.7  # uniform ones: 0


@pytest.mark.long
def test_the_same_bytes_whoever_draws(tmp_path):
    spec, files = scenegen.parse(SPEC), []
    for workers in (1, 2):
        scenes = scenegen.sample(spec, (LOW, HIGH), 500, seed=3, workers=workers)
        scenes.save(path := tmp_path / f"{workers}.jsonl")
        files.append(path.read_bytes())
    assert files[0] == files[1]


def test_a_narrow_prior_costs_no_rejections():
    text = "object mug, plate\nusually mug ~ normal((0.2, 0.5), 1 mm)\ntask: leftOf(mug, plate)\n"
    sampler = scenegen.sample(scenegen.parse(text), (0.0, 0.2), 1000, method="rejection").header.sampler
    assert sampler["acceptance"] > 0.9 * 10.0 ** sampler["log10_probability"] > 0.1


CROWD_ROUND_A_PLATE = """object block[4], plate
usually block ~ normal(plate, 15 cm)
task: forall b in block: leftOf(b, plate)
"""


def test_what_many_are_relative_to_is_cut_where_scenes_are_worth_it():
    many, few = (
        scenegen.sample(scenegen.parse(CROWD_ROUND_A_PLATE), (0.02, 0.05), n, spread="base").header.sampler
        for n in (20_000, 20)
    )
    share = 10.0 ** many["log10_probability"]
    assert many["acceptance"] > 4.0 * share and few["acceptance"] < 2.0 * share
    assert abs(many["log10_probability"] - few["log10_probability"]) <= many["log10_error"] + few["log10_error"]


def test_without_a_prior_nothing_changes_and_with_one_the_box_stays():
    plain, spec = scenegen.parse("object mug\ntask: x(mug) >= 0\n").checked, scenegen.parse(SPEC).checked
    over, base = pull_back(plain, *plain.box())
    assert over.core == plain.core and not base.at
    over, base = pull_back(spec, *spec.box())
    assert sorted(base.at) == [0, 1, 2, 3, 4, 6, 7] and all(
        (a == b).all() for a, b in zip(over.box(), spec.box(), strict=True)
    )
    rng = np.random.default_rng(8)
    rows = spec.box()[0][:, None] + rng.random((9, 1000)) * (spec.box()[1] - spec.box()[0])[:, None]
    given = np.where(rng.random(rows.shape) < 0.5, base.poses(rows), np.nan)
    again = base.poses(rows, given)
    assert (again[~np.isnan(given)] == given[~np.isnan(given)]).all()
