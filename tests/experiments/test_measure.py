"""What is measured of scenes, against scenes worked out by hand."""

import numpy as np
import pytest

from experiments.known import HITS, KNOWN
from experiments.measure import (
    accuracy,
    columns,
    covered,
    in_range,
    ks_distance,
    margins,
    phi_of,
    rows_of,
    shares,
    target,
)
from experiments.problems import BAND, ORDERINGS, PROBLEMS
from experiments.samplers import plain_rejection
from scenegen.api.sample import sample

EXP1, SORT = PROBLEMS["exp1"], PROBLEMS["exp3_3"]


def blocks(*centres):
    """One scene (9, 1) of three blocks."""
    return np.array([[x, y, 0.0] for x, y in centres]).reshape(-1, 1)


@pytest.mark.parametrize(
    "scene, ordering, margin",
    [
        (blocks((0.1, 0.5), (0.3, 0.5), (0.35, 0.5)), 0, 0.05),
        (blocks((0.9, 0.5), (0.7, 0.6), (0.2, 0.5)), 1, 0.2),
        (blocks((0.5, 0.1), (0.4, 0.2), (0.5, 0.4)), 2, 0.1),
        (blocks((0.5, 0.9), (0.4, 0.2), (0.5, 0.1)), 3, 0.1),
    ],
)
def test_orderings(scene, ordering, margin):
    found = margins(scene)
    assert found[:, 0].argmax() == ordering and found[ordering, 0] == pytest.approx(margin)
    # the spec says the same
    assert phi_of(SORT.load(), scene)[0, 0] == pytest.approx(margin)
    assert shares(SORT, scene, "raw")[f"raw:{ORDERINGS[ordering]}"] == 1.0


def test_shares_are_of_orderings_only():
    scenes = np.concatenate([blocks((0.1, 0), (0.3, 0), (0.5, 0))] * 3 + [blocks((0, 0.1), (0, 0.3), (0, 0.5))], axis=1)
    assert list(shares(SORT, scenes, "x").values()) == [0.75, 0.0, 0.25, 0.0]
    assert shares(EXP1, scenes, "x") == {} and shares(SORT, scenes[:, :0], "x") == {}


def test_errors_and_range_by_hand():
    """Mug at the upper left: dx = 0.2, dy = 0.3, so task = 0.2, safe = sqrt(0.13) - 0.25; wanted (0.19, 0.08)."""
    spec, scene = EXP1.load(), np.array([0.3, 0.8, 0.0, 0.5, 0.5, 0.0]).reshape(-1, 1)
    safe = np.sqrt(0.13) - 0.25
    found = accuracy(EXP1, spec, scene)
    assert found["mean:task"] == pytest.approx(0.01) and found["error:safe"] == pytest.approx(safe - 0.08)
    assert found["within"] == 0.0 and in_range(EXP1, spec, scene) == 0.0
    truth = rows_of(sample(spec, EXP1.band, 50, seed=0, spread="base"))
    assert in_range(EXP1, spec, truth) == 1.0
    assert in_range(EXP1, spec, np.concatenate([truth, np.repeat(scene, 50, axis=1)], axis=1)) == 0.5


def test_no_scenes_cover_nothing():
    spec = EXP1.load()
    truth = rows_of(sample(spec, EXP1.band, 64, seed=0, spread="base"))
    assert covered(truth, truth[:, :0]) == 0.0 and in_range(EXP1, spec, truth[:, :0]) == 0.0
    assert covered(truth, truth) == 1.0


def test_targets_are_in_the_order_of_the_labels():
    assert target(EXP1, ("task", "safe"), 2).tolist() == [[pytest.approx(0.19)] * 2, [pytest.approx(0.08)] * 2]
    assert columns({"a": 1.0, "b": 2.0}, ("b", "a"), 1).tolist() == [[2.0], [1.0]]


def test_plain_rejection_finds_the_share_that_the_exact_sampler_names():
    problem = PROBLEMS["exp3_5"]
    spec, draws = problem.load(), 4 * 65_536
    hits, _ = plain_rejection(problem, spec, draws)
    scenes = sample(spec, problem.band, 2_000, seed=0, spread="base", method="rejection")
    expected = draws * 10.0 ** scenes.header.sampler["log10_probability"]
    assert abs(hits.shape[1] - expected) < 5.0 * np.sqrt(expected)
    assert (abs(phi_of(spec, hits) - 0.05) <= BAND).all()
    again, _ = plain_rejection(problem, spec, draws)
    assert (again == hits).all()


@pytest.mark.parametrize("key", PROBLEMS)
def test_what_was_there_before_fits_the_labels(key):
    labels = PROBLEMS[key].load().labels
    assert set(labels) == set(PROBLEMS[key].wanted) and key in HITS
    for one in KNOWN[key]:
        assert len(one.error) in (0, len(labels)) and len(one.absolute) in (0, len(labels))
        assert one.error or one.absolute


def test_ks_distance_sees_what_coverage_does_not():
    generator = np.random.default_rng(0)
    reference, same, narrowed = (generator.random((6, 2000)) for _ in range(3))
    narrowed[1, 1000:] = 0.4 + 0.2 * narrowed[1, 1000:]  # half of the scenes crowd in the middle
    assert ks_distance(reference, same) < 0.06
    assert 0.18 < ks_distance(reference, narrowed) < 0.25  # 0.2 but for noise
    assert covered(reference, narrowed) > 0.9  # and would pass for diverse
    assert ks_distance(reference, reference[:, :0]) == 1.0
