"""The last step of a model: onto the wanted phi, within what is required, without changing what is right."""

import math

import numpy as np
import pytest
import torch
from scipy import stats

from experiments.metrics import kolmogorov_smirnov
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import REQUIRE, gate
from scenegen.learn.models.codec import Codec
from scenegen.learn.models.correction import Correction, McmcMoves
from scenegen.learn.models.correction import _newton as newton
from scenegen.learn.robustness import Robustness
from scenegen.search.effort import NEVER

TEXT = """object a = cylinder(0.05, 0.1), b = cylinder(0.05, 0.1), c = cylinder(0.05, 0.1) at (0.5, 0.5)
require noOverlap()
near: closeTo(a, b, 0.3) & leftOf(a, b)
apart: farFrom(b, c, 0.2)
"""


@pytest.fixture(scope="module")
def spec():
    return check_text(TEXT, "three.spec")


def uniform(spec):
    """A proposer that knows nothing of phi."""
    codec = Codec(spec.workspace, len(spec.objects))

    def make(wanted, generator, branch, stop=NEVER):
        rows = codec.decode(torch.rand(wanted.shape[1], 3 * len(spec.objects), generator=generator))
        rows[6:9] = torch.tensor([0.5, 0.5, 0.0])[:, None]
        return rows, None

    return make


def of(spec, rows):
    return Robustness(gate(spec.core)).rows(rows)


@pytest.mark.parametrize("wanted", [(-0.2, 0.1), (0.1, math.nan), (math.nan, -0.1)])
def test_scenes_come_to_the_wanted_phi_and_meet_what_is_required(spec, wanted):
    phi = torch.tensor(wanted)[:, None].expand(2, 400)
    correct = Correction(spec, torch.tensor([1.0, 1.0]))
    rows = correct(uniform(spec), phi, torch.Generator().manual_seed(1))
    found = of(spec, rows)
    good = found[-1] >= 0.0
    for place, value in enumerate(wanted):
        if not math.isnan(value):
            good &= (found[place] - value).abs() <= 1.1e-3
    assert float(good.float().mean()) > 0.97
    assert bool(((rows[0::3] >= 0.0) & (rows[0::3] <= 1.0) & (rows[1::3] >= 0.0) & (rows[1::3] <= 1.0)).all())
    assert bool((rows[6:8] == 0.5).all()) and bool((rows[8] == 0.0).all())  # held in place


def test_the_generator_alone_decides_and_scenes_that_are_right_stay_near(spec):
    phi = torch.tensor([0.1, 0.2])[:, None].expand(2, 300)
    correct = Correction(spec, torch.tensor([1.0, 1.0]))
    one, two = (correct(uniform(spec), phi, torch.Generator().manual_seed(3)) for _ in range(2))
    assert torch.equal(one, two)
    walk = correct._walk
    right = walk._inside(one, phi - walk._tolerance, phi + walk._tolerance)
    again, _ = correct._correct(one, phi, NEVER)
    assert float(right.float().mean()) > 0.9 and torch.equal(again[:, right], one[:, right])


def test_newton_is_the_shortest_step_that_closes_the_gaps():
    random = torch.Generator().manual_seed(0)
    jacobian = torch.randn(2, 6, 50, generator=random)
    gap = 0.01 * torch.randn(2, 50, generator=random)
    far = torch.ones(2, 50, dtype=torch.bool)
    step = newton(jacobian, gap, far)
    torch.testing.assert_close((jacobian * step).sum(1), gap, atol=2e-4, rtol=0.0)
    expected = torch.stack([torch.linalg.pinv(jacobian[:, :, k]) @ gap[:, k] for k in range(50)], 1)
    torch.testing.assert_close(step, expected, atol=2e-4, rtol=0.0)
    one = newton(jacobian[:1], gap[:1], far[:1])
    torch.testing.assert_close((jacobian[0] * one).sum(0), gap[0], atol=1e-5, rtol=0.0)


def test_moves_keep_phi_and_what_is_required(spec):
    phi = torch.tensor([-0.1, math.nan])[:, None].expand(2, 500)
    correct = Correction(spec, torch.tensor([1.0, 1.0]))
    rows, off = correct._correct(uniform(spec)(phi, torch.Generator().manual_seed(1), None)[0], phi, NEVER)
    stir = McmcMoves(spec, torch.full((2, 1), 1e-3))
    assert stir.count
    moved = stir(rows, phi, torch.Generator().manual_seed(2))
    assert torch.equal(moved[:, off], rows[:, off]) and not torch.equal(moved[:, ~off], rows[:, ~off])
    found = of(spec, moved[:, ~off])
    assert bool(((found[0] + 0.1).abs() <= 1.01e-3).all()) and bool((found[-1] >= 0.0).all())
    assert bool((moved[6:8] == 0.5).all())


def test_moves_leave_the_truth_alone_and_mend_what_is_not():
    """Uniform scenes of a band stay uniform; crowded ones become more so."""
    spec = check_text("object a, b\ntask: closeTo(a, b, 0.4)", "two.spec")
    band = torch.full((1, 1), 0.1)  # phi within 0.1 of 0.1
    stir = McmcMoves(spec, band)
    generator = torch.Generator().manual_seed(0)
    rows = Codec(spec.workspace, 2).decode(torch.rand(60_000, 6, generator=generator))
    inside = (of(spec, rows)[0] - 0.1).abs() <= 0.1
    true = rows[:, inside]
    wanted = torch.full((1, true.shape[1]), 0.1)
    true, fresh = true[:, ::2], true[:, 1::2]
    stirred = stir(fresh, wanted[:, : fresh.shape[1]], generator)
    for left, right in (([0], [0]), ([0, 3], [0, 3]), ([1, 4], [1, 4])):
        numbers = [float(1 - 2 * k) for k in range(len(left))]
        a, b = (
            sum(number * part[row] for number, row in zip(numbers, which, strict=True)).double().numpy()
            for part, which in ((true, left), (stirred, right))
        )
        assert kolmogorov_smirnov(a, b)[1] > 1e-4
    crowded = fresh[:, fresh[0] < fresh[3]]  # only the half with a to the left
    apart = []
    for some in (crowded, stir(crowded, wanted[:, : crowded.shape[1]], generator)):
        a, b = ((part[0] - part[3]).double().numpy() for part in (true, some))
        apart.append(kolmogorov_smirnov(np.asarray(a), np.asarray(b))[0])
    assert apart[0] > 0.4 and apart[1] < 0.5 * apart[0]


@pytest.mark.parametrize(("arrive", "share"), [(0.5, 0.5), (0.0, 1.0)])
def test_what_is_drawn_again_is_drawn_in_its_branch(spec, arrive, share):
    """A branch that is missed half the time keeps its share; one that is always missed is given up for another."""
    asked = []

    def make(wanted, generator, branch, stop=NEVER):
        count = wanted.shape[1]
        asked.append(branch)
        branch = torch.rand(count, generator=generator).lt(0.5).long() if branch is None else branch
        rows, _ = uniform(spec)(wanted, generator, branch)
        rows[0] = branch.float()
        rows[2] = ((branch == 0) & (torch.rand(count, generator=generator) >= arrive)).float()
        return rows, branch

    correct = Correction(spec, torch.tensor([1.0, 1.0]))
    correct._correct = lambda rows, wanted, stop: (rows.clone(), rows[2] > 0.0)
    correct._walk.count = 0
    made = correct(make, torch.zeros(2, 2000), torch.Generator().manual_seed(2))
    assert asked[0] is None and bool((asked[1] == 0).all())
    assert float(made[0].double().mean()) == pytest.approx(share, abs=0.04)


def test_what_is_out_of_reach_is_given_up_soon(spec):
    made = []

    def make(wanted, generator, branch, stop=NEVER):
        made.append(wanted.shape[1])
        return uniform(spec)(wanted, generator, branch)

    phi = torch.tensor([5.0, math.nan])[:, None].expand(2, 100)
    rows = Correction(spec, torch.tensor([1.0, 1.0]))(make, phi, torch.Generator().manual_seed(1))
    assert bool(torch.isfinite(rows).all()) and sum(made) <= 500


def test_the_requirement_is_a_value_of_its_own(spec):
    assert list(gate(spec.core).labels) == ["near", "apart", REQUIRE]


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_fitted_moves_spread_scenes_over_a_range_however_narrow(tolerance):
    """From its very middle; moves of the usual sizes leave nearly all where they are."""
    text = f"object a, b\ntask: abs(x(a) - 30 cm) <= {tolerance} & abs(x(b) - x(a) - 20 cm) <= {tolerance}"
    stir = McmcMoves(check_text(text, "narrow.spec"), torch.zeros(1, 1))
    count, ends = 2000, (torch.zeros(1, 2000), torch.full((1, 2000), math.inf))
    rows = torch.rand(6, count, generator=torch.Generator().manual_seed(0))
    rows[0], rows[3] = 0.3, 0.5
    far = []
    for fit in (True, False):
        made = stir.move_within(rows, ends, torch.Generator().manual_seed(1), 120, fit=fit).double()
        places = ((made[0] - 0.3) / tolerance, (made[3] - made[0] - 0.2) / tolerance)
        far.append(max(stats.kstest(one.numpy(), "uniform", args=(-1, 2)).statistic for one in places))
    assert far[0] < 0.05 and far[1] > 0.2
