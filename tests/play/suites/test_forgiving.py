"""Starts for people: on the grid, and proved to forgive errors of placing."""

import re
from itertools import pairwise

import numpy as np
import pytest

from scenegen.api.sample import draw_scenes
from scenegen.errors import RequestError
from scenegen.play.stage.check import margins_at
from scenegen.play.suites.forgiving import EXACT_PLACING, Placing, join_scenes
from scenegen.play.suites.new import new_suite
from scenegen.play.suites.suite import Suite, check_suite
from scenegen.sampling.request import SampleRequest
from scenegen.search.effort import Budget

ERRORS = (0.015, np.radians(15.0))
WIDE = {"beside": (-0.349, -0.099), "order": (-0.33, -0.175), "mat": (-0.166, 0.0), "turn": (-0.299, -0.08)}


@pytest.fixture(scope="module")
def suite():
    return Suite.load("tabletop")


def starts_of(suite, name):
    task = next(one for one in suite.tasks if one.name == name)
    phi = task.scenes.phi[task.success]
    return task, task.scenes[(phi >= WIDE[name][0]) & (phi <= WIDE[name][1])]


@pytest.mark.long
@pytest.mark.parametrize("name", WIDE)
def test_no_error_within_the_tolerance_leaves_the_band(suite, name):
    task, scenes = starts_of(suite, name)
    kept = Placing(ERRORS).keep(task.spec, scenes, {task.success: WIDE[name]}, Budget(60.0))
    assert 5 < len(kept) < len(scenes)
    rng, start = np.random.default_rng(1), task.start(0, 0)
    for poses in kept.poses[:10]:
        inner = rng.uniform(-1.0, 1.0, (2000, *poses.shape))
        corners = rng.choice((-1.0, 1.0), (2000, *poses.shape))
        phi, required = margins_at(start, poses + np.concatenate([inner, corners]) * (ERRORS[0], *ERRORS))
        assert phi.min() >= WIDE[name][0] and phi.max() <= WIDE[name][1] and required.min() >= 0.0


@pytest.mark.long
def test_noise_of_hands_hardly_ever_leaves_it(suite):
    """7 mm and 5 degrees, as standard deviations."""
    rng, inside, count = np.random.default_rng(2), 0, 0
    for name, (low, high) in WIDE.items():
        task, scenes = starts_of(suite, name)
        kept = Placing(ERRORS).keep(task.spec, scenes, {task.success: WIDE[name]}, Budget(60.0))
        for poses in kept.poses[:15]:
            noise = rng.normal(0.0, (0.007, 0.007, np.radians(5.0)), (200, *poses.shape))
            phi, required = margins_at(task.start(0, 0), poses + noise)
            inside += int(((phi >= low) & (phi <= high) & (required >= 0.0)).sum())
            count += 200
    assert inside >= 0.99 * count


def test_scenes_on_the_grid_are_still_what_they_should_be(suite):
    task, scenes = starts_of(suite, "beside")
    wanted = WIDE["beside"]
    kept = Placing(grid=0.02, headings=np.radians(15.0)).keep(task.spec, scenes, {task.success: wanted}, Budget(60.0))
    poses = kept.poses
    assert 20 < len(kept) <= len(scenes)
    assert np.allclose(poses[..., :2] / 0.02, np.round(poses[..., :2] / 0.02), atol=1e-6)
    assert np.allclose(np.degrees(poses[..., 2]) / 15.0, np.round(np.degrees(poses[..., 2]) / 15.0), atol=1e-6)
    phi, required = margins_at(task.start(0, 0), poses)
    assert np.allclose(kept.phi[task.success], phi) and phi.min() >= wanted[0] and phi.max() <= wanted[1]
    assert required.min() >= 0.0 and abs(poses[..., :2]).max() <= 0.15


def test_exact_starts_stay_as_they_are(suite):
    task, scenes = starts_of(suite, "turn")
    kept = EXACT_PLACING.keep(task.spec, scenes, {task.success: WIDE["turn"]}, Budget(60.0))
    assert np.array_equal(kept.poses, scenes.poses) and len(join_scenes([kept, kept])) == len(kept)


@pytest.mark.long
def test_a_suite_for_hands(root, tmp_path):
    placing = Placing((0.01, 0.1), 0.01, np.radians(15.0))
    path = root / "suites" / "tabletop" / "sides.spec"
    spec = tmp_path / "sides.spec"
    spec.write_text(path.read_text().replace("# reverse", "# "))
    new_suite([("sides", spec)], tmp_path / "hand", bands=2, n=6, placing=placing, workers=1)
    (suite,) = check_suite(tmp_path / "hand")
    assert len(suite) == 12 and "grid of 0.01 m" in suite.tasks[0].scenes.header.sampler["placing"]
    again = placing.keep(
        suite.tasks[0].spec, suite.tasks[0].scenes[:6], {"goal": suite.tasks[0].bands[0].phi}, Budget(60.0)
    )
    assert len(again) == 6, "what is kept is kept again"


@pytest.mark.long
def test_a_tolerance_that_no_start_has(root, tmp_path):
    spec = root / "suites" / "tabletop" / "apart.spec"
    with pytest.raises(RequestError) as caught:
        new_suite([("apart", spec)], tmp_path / "none", bands=5, n=2, placing=Placing((0.05, 0.0)), workers=1)
    (wrong,) = caught.value.diagnostics
    assert wrong.kind.code == "out-of-range" and "0 of" in wrong.text("help") and not (tmp_path / "none").exists()


@pytest.mark.long
def test_what_would_do_where_bands_are_too_narrow(suite):
    """The bands and the tolerance that are advised have such starts, as many bands as there can be."""
    task = next(one for one in suite.tasks if one.name == "beside")
    ranges = [band.phi for band in task.bands]
    said = Placing(ERRORS).advise(task.spec, "goal", ranges, True, 0, Budget(100.0))
    bands, _, tolerance = said.partition(" or --tolerance ")
    ends = [tuple(map(float, one)) for one in re.findall(r"=(\S+?):(\S+)", bands)]
    assert 2 <= len(ends) < 5 and ends[0][1] == ranges[0][1] and ends[-1][0] == ranges[-1][0]
    assert all(one[0] == other[1] for one, other in pairwise(ends))
    cm, degrees = map(float, re.fullmatch(r"(\S+)cm,(\d+)deg", tolerance).groups())
    assert 0.3 <= cm < 1.5
    request = SampleRequest({}, 3000, seed=9, spread="base", workers=1)
    scenes = draw_scenes(task.spec, request)
    for errors, some in ((ERRORS, ends), ((cm / 100.0, np.radians(degrees)), ranges)):
        for one in some:
            assert len(Placing(errors).keep(task.spec, scenes, {"goal": one}, Budget(100.0)))
    assert Placing(ERRORS).advise(task.spec, "goal", ranges, False, 0, Budget(100.0)) == f"--tolerance {tolerance}"


def test_a_tolerance_that_is_none():
    with pytest.raises(RequestError):
        Placing((-0.01, 0.0))
