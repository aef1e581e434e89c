"""Figures of generated scenes: what each sees, and what truth scores."""

import numpy as np
import pytest

from scenegen.errors import DataError
from scenegen.learn.evaluation.fidelity import Fidelity, energy_distance, fidelity, sliced_distance


def scenes(seed, count=600):
    """Two objects: uniform places, headings anywhere."""
    random = np.random.default_rng(seed)
    rows = random.random((6, count))
    rows[2::3] *= 2.0 * np.pi
    return rows


def test_truth_scores_well():
    found = fidelity(scenes(0), scenes(1))
    assert found.coverage > 0.93 and found.ks < 0.12 and found.sliced < 0.14 and abs(found.energy) < 0.01


def test_a_lost_degree_of_freedom_is_seen_by_products_and_not_by_single_coordinates():
    """x and y of the first object, each uniform and tied to each other."""
    made = scenes(1)
    made[1] = np.random.default_rng(2).permutation(made[1])
    noise = 0.2 * np.random.default_rng(3).normal(size=600)
    order = np.argsort(np.argsort(made[0] + noise))
    made[1] = np.sort(made[1])[order]
    found = fidelity(scenes(0), made)
    assert found.ks < 0.12 and found.sliced > 0.2 and found.energy > 0.01


def test_what_is_left_out_and_what_crowds():
    half, crowded = scenes(1), scenes(1)
    half[0] *= 0.5
    crowded[0] **= 2
    assert fidelity(scenes(0), half).coverage < 0.85
    assert fidelity(scenes(0), crowded).ks > 0.2


def test_only_what_phi_depends_on_counts():
    made = scenes(1)
    made[3] = 0.5
    assert fidelity(scenes(0), made).ks > 0.4
    assert fidelity(scenes(0), made, [0, 1, 5]).ks < 0.12
    assert fidelity(scenes(0), made, []) == Fidelity(1.0, 0.0, 0.0, 0.0)


def test_headings_have_no_beginning():
    true, made = scenes(0), scenes(1)
    for rows in (true, made):
        rows[2] = np.random.default_rng(int(1e6 * rows[0, 0])).normal(0.0, 0.2, 600) % (2.0 * np.pi)
    moved = made.copy()
    moved[2] += 2.0 * np.pi
    assert fidelity(true, moved, [2]) == pytest.approx(fidelity(true, made, [2]), abs=1e-6) or (
        fidelity(true, moved, [2]).ks == pytest.approx(fidelity(true, made, [2]).ks, abs=1e-6)
    )


def test_the_energy_distance_is_its_definition():
    random = np.random.default_rng(5)
    a, b = random.normal(size=(40, 3)), random.normal(size=(30, 3)) + 0.5
    pooled = np.concatenate([a, b])
    values, axes = np.linalg.eigh(np.cov(pooled.T, bias=True))
    white = (pooled - pooled.mean(0)) @ (axes / np.sqrt(values))
    apart = np.linalg.norm(white[:, None] - white[None], axis=2)
    expected = 2 * apart[:40, 40:].mean() - apart[:40, :40].sum() / (40 * 39) - apart[40:, 40:].sum() / (30 * 29)
    assert energy_distance(a, b) == pytest.approx(expected, abs=1e-5)


def test_slices_do_not_depend_on_units():
    a, b = np.random.default_rng(0).normal(size=(2, 300, 1))
    assert sliced_distance(a, b) == 0.0  # one coordinate has no slices
    a, b = np.random.default_rng(0).normal(size=(2, 300, 2))
    assert 0.0 < sliced_distance(a, b) == pytest.approx(sliced_distance(10 * a, 10 * b), abs=1e-9)


def test_bad_input_is_a_diagnostic():
    with pytest.raises(DataError):
        fidelity(scenes(0, 5), scenes(1))
