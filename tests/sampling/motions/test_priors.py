"""Motions that begin where things usually are, against plain rejection of first scenes drawn by hand with scipy, and
steps: by both methods, with things held; their probability; what is refused.
"""

import math

import numpy as np
import pytest
from scipy import stats

import scenegen
from scenegen.errors import RequestError, SpecError
from scenegen.sampling.motions.problem import draw, poses_of, within_a_turn
from scenegen.sampling.motions.scores import make_motion_problem
from scenegen.sampling.request import SampleRequest

SPEC = """object mug, saucer, plate
time 4 steps
{moves}usually mug ~ normal((0.3, 0.9), 15 cm)
usually theta(mug) ~ normal(NORTH, 40 deg)
usually saucer ~ normal(mug, 10 cm)
usually plate ~ [normal((0.8, 0.2), 8 cm): 3, normal((0.2, 0.2), 5 cm): 1]
require speed(mug) <= 20 cm/s & spin(mug) <= 30 deg/s & speed(saucer) <= 20 cm/s & displacement(plate) <= 0 cm
task: (finally closeTo(mug, plate, 55 cm)) & (always leftOf(saucer, plate))
"""
FAR, TURN, STEPS = 0.2, math.radians(30), 4
LOW = -0.05


def cut_off(middle, deviation, rng, count):
    ends = (0.0 - middle) / deviation, (1.0 - middle) / deviation
    return stats.truncnorm.rvs(*ends, loc=middle, scale=deviation, size=count, random_state=rng)


def first_scenes(rng, count, mug=None):
    """(count, 3, 3): where the things of SPEC are at first; the mug at a pose, where there is one."""
    made = rng.random((count, 3, 3))
    made[..., 2] *= math.tau
    for axis, middle in ((0, 0.3), (1, 0.9)):
        made[:, 0, axis] = cut_off(middle, 0.15, rng, count)
    turned = stats.truncnorm.rvs(-4.5, 4.5, scale=math.radians(40), size=count, random_state=rng)
    made[:, 0, 2] = (math.pi / 2 + turned) % math.tau
    if mug is not None:
        made[:, 0] = mug
    near = rng.random(count) < 0.25
    for axis in (0, 1):
        made[:, 1, axis] = cut_off(made[:, 0, axis], 0.1, rng, count)
        far = cut_off(0.8 if axis == 0 else 0.2, 0.08, rng, count)
        made[:, 2, axis] = np.where(near, cut_off(0.2, 0.05, rng, count), far)
    return made


def motions(rng, count, moves, held=None):
    """Motions by hand, those in the workspace: (n, 5, 3, 3)."""
    poses = [first_scenes(rng, count, held)]
    movers = [1] if held is not None else [0, 1]
    for _ in range(STEPS):
        now, mover = poses[-1].copy(), rng.choice(movers, size=count)
        for thing in movers:
            goes = (mover == thing) | (moves == "all")
            angle, way = math.tau * rng.random(count), FAR * np.sqrt(rng.random(count))
            now[:, thing, 0] += goes * way * np.cos(angle)
            now[:, thing, 1] += goes * way * np.sin(angle)
            now[:, thing, 2] += goes * (thing == 0) * TURN * rng.uniform(-1, 1, count)
        poses.append(now)
    made = np.stack(poses, axis=1)
    places = made[..., :2]
    made[..., 2] %= math.tau
    return made[((places >= 0.0) & (places <= 1.0)).all(axis=(1, 2, 3))]


def phi(made):
    ends = 0.55 - np.hypot(*np.moveaxis(made[:, -1, 0, :2] - made[:, -1, 2, :2], -1, 0))
    return np.minimum(ends, (made[:, :, 2, 0] - made[:, :, 1, 0]).min(axis=1))


def by_rejection(moves, held=None):
    """Motions in range, and log10 of how rare they are."""
    rng, found, drawn = np.random.default_rng(3), [], 0
    for _ in range(8):
        made = motions(rng, 50_000, moves, held)
        drawn += 50_000
        found.append(made[phi(made) >= LOW])
    kept = np.concatenate(found)
    return kept, math.log10(len(kept) / drawn)


def rows(poses):
    """Places and directions of headings, (rows, n)."""
    flat = poses.reshape(len(poses), -1, 3)
    theta = flat[..., 2]
    return np.concatenate([flat[..., 0], flat[..., 1], np.cos(theta), np.sin(theta)], axis=1).T


def worst(one, other):
    """The largest Kolmogorov-Smirnov distance of coordinates and of directions through them."""
    one, other = rows(one), rows(other)
    rng = np.random.default_rng(0)
    axes = np.concatenate([np.eye(len(one)), rng.normal(size=(20, len(one)))])
    return max(stats.ks_2samp(axis @ one, axis @ other).statistic for axis in axes)


@pytest.mark.parametrize("moves", ["one", "all"])
def test_first_scenes_follow_the_prior(moves):
    spec = scenegen.parse(SPEC.format(moves=f"moves {moves}\n"))
    problem = make_motion_problem(spec.definition, SampleRequest({}, n=1))
    poses = within_a_turn(poses_of(problem, draw(problem, 20_000, np.random.default_rng(1))))
    assert worst(poses[:, :, :1].transpose(3, 2, 0, 1), first_scenes(np.random.default_rng(2), 100_000)[:, None]) < 0.02


@pytest.mark.long
@pytest.mark.parametrize("moves", ["one", "all"])
@pytest.mark.parametrize("method", ["rejection", "splitting"])
def test_motions_follow_the_prior(method, moves):
    truth, log10 = by_rejection(moves)
    spec = scenegen.parse(SPEC.format(moves=f"moves {moves}\n"))
    made = scenegen.sample_motions(spec, (LOW, None), 4000, seed=5, method=method, spread="base", timeout=200.0)
    info = made.header.sampler
    assert info["method"] == method
    assert worst(made.poses, truth) < 0.04
    assert info["log10_probability"] == pytest.approx(log10, abs=2.0 * info["log10_error"] + 0.01)
    assert np.abs(phi(made.poses) - made.phi["task"]).max() < 1e-9


@pytest.mark.long
def test_what_is_held_stays_and_what_is_relative_to_it_follows():
    spec, mug = scenegen.parse(SPEC.format(moves="")), (0.4, 0.7, 1.0)
    made = scenegen.sample_motions(spec, (LOW, None), 2000, fix={"mug": mug}, spread="base").poses
    assert (made[:, :, 0] == mug).all()
    assert worst(made, by_rejection("one", mug)[0]) < 0.05
    with pytest.raises(RequestError, match="`saucer` cannot be held while `mug` is free"):
        scenegen.sample_motions(spec, (LOW, None), 10, fix={"saucer": (0.3, 0.8)})


@pytest.mark.long
def test_how_rare_motions_are_is_told_with_the_prior():
    found = scenegen.rarity(scenegen.parse(SPEC.format(moves="")))
    levels = [one for one in found.labels[0].curve if one.above is not None]
    above = np.interp(LOW, [one.phi for one in levels], [one.above.log10 for one in levels])
    assert found.requirement.log10 + above == pytest.approx(by_rejection("one")[1], abs=0.1)


def test_motions_of_elements_regions_and_recorded_poses():
    text = """object block[2], mug, can
time 3 steps
region left = polygon([(0, 0), (0.3, 0), (0, 0.6)])
usually block ~ uniform(left)
usually mug, can ~ poses([[(0.7, 0.2, 0), (0.8, 0.3, 90 deg)], [(0.5, 0.9, 0), (0.6, 0.9, 0)]], 1 cm, 5 deg)
require forall a in objects: speed(a) <= 5 cm/s
task: always closeTo(block[1], mug, 90 cm)
"""
    made = scenegen.sample_motions(scenegen.parse(text), (0.0, None), 400, spread="base").poses
    over = made[:, :, :2, 1] + 2.0 * made[:, :, :2, 0] - 0.6
    assert (over[:, 0] <= 1e-9).all() and (over[:, 3] > 0.0).any()
    first = made[:, 0, 2, 0] > 0.6
    assert 0.3 < first.mean() < 0.7
    assert np.allclose(made[first, 0, 2:, :2], [[0.7, 0.2], [0.8, 0.3]], atol=0.0101)
    assert np.allclose(made[~first, 0, 2:, :2], [[0.5, 0.9], [0.6, 0.9]], atol=0.0101)


def test_where_motions_begin_cannot_depend_on_steps():
    text = SPEC.format(moves="").replace("normal(mug, 10 cm)", "normal((x(mug) + displacement(mug), 0.5), 1 cm)")
    with pytest.raises(SpecError, match="cannot depend on how they move"):
        scenegen.parse(text)
