import dataclasses

import numpy as np
import pytest
import torch

from scenegen.errors import RequestError
from scenegen.geometry import ANGLE, LENGTH
from scenegen.geometry.workspace import Workspace
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, gated
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.robustness import Robustness
from scenegen.learn.training.balanced import balanced
from scenegen.learn.training.config import DATASETS, dataset_maker
from scenegen.learn.training.paper import boosted, uniform

SPACE = Workspace(x=(-0.3, 0.1), y=(0.7, 2.0))


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)


def numpy_phi(rows):
    """Experiment 1's labels, written out here."""
    mx, my, _, px, py, _ = rows.double().numpy()
    return np.stack([np.minimum(px - mx, my - py), np.hypot(mx - px, my - py) - 0.25])


def narrow(limit, axis=0):
    """One object whose x (or theta) must be at most `limit`: as rare as one likes."""
    nodes = (Const(limit), Coord(0, axis), Apply("sub", (0, 1)), Atom(2, "atom", (LENGTH, ANGLE)[axis // 2], ()))
    return CheckedSpec("narrow.spec", f"task: {limit} {axis}\n", Workspace(), Core(nodes, {"task": 3}, ("mug",)))


@pytest.mark.long
@pytest.mark.parametrize("name", DATASETS)
def test_every_data_set(name, make_exp1):
    spec = make_exp1(SPACE)
    data = dataset_maker(name)(spec, 500, seeded())
    assert data.rows.shape == (6, 500) and data.phi.shape == (2, 500) and len(data) == 500
    assert data.rows.dtype == data.phi.dtype == torch.float32
    assert (data.objects, data.labels) == (("mug", "plate"), ("task", "safe"))
    assert SPACE.contains(data.rows.double().numpy()).all()
    np.testing.assert_allclose(data.phi.numpy(), numpy_phi(data.rows), atol=1e-6)
    again, other = (dataset_maker(name)(spec, 500, seeded(seed)) for seed in (0, 1))
    assert torch.equal(again.rows, data.rows) and again.sha256 == data.sha256 != other.sha256
    with pytest.raises(dataclasses.FrozenInstanceError):
        data.rows = data.rows


def test_uniform_rates_of_experiment_1(exp1):
    data = uniform(exp1, 20_000, seeded())
    # P(task) = 25 % exactly, P(both) = 21.1 %; 4 standard errors are 1.2 %.
    assert float((data.phi[0] >= 0.0).float().mean()) == pytest.approx(0.25, abs=0.012)
    assert data.positives == pytest.approx(0.211, abs=0.012)
    means = data.rows.mean(dim=1).tolist()
    assert means == pytest.approx([0.5, 0.5, np.pi] * 2, abs=0.06)


def test_boosting_reaches_its_share_and_keeps_the_rest_uniform(exp1):
    data = boosted(exp1, 4000, seeded(), positives=0.56)
    assert data.positives == pytest.approx(0.56, abs=1e-3)
    good = (data.phi >= 0.0).all(dim=0)
    # Positives stand in random places, not in one block that batches would see at once.
    assert float(good[:2000].float().mean()) == pytest.approx(0.56, abs=0.04)
    assert torch.unique(data.rows, dim=1).shape[1] == 4000


def test_nothing_is_perturbed_where_the_share_is_there(exp1):
    plain, same = uniform(exp1, 1000, seeded()), boosted(exp1, 1000, seeded(), positives=0.1)
    assert torch.equal(plain.rows, same.rows)


def test_rare_positives_are_searched_for_and_stay_inside():
    spec = narrow(1e-4)
    data = boosted(spec, 300, seeded(), positives=0.5)
    assert data.positives == pytest.approx(0.5, abs=0.01)
    assert spec.workspace.contains(data.rows.double().numpy()).all()


def test_theta_is_wrapped_when_moved():
    data = boosted(narrow(0.02, axis=2), 300, seeded(), positives=0.9, noise=0.3)
    assert data.positives >= 0.9
    assert SPACE.contains(data.rows.double().numpy()).dtype == bool
    assert bool(((data.rows[2] >= 0.0) & (data.rows[2].double() < 2.0 * np.pi)).all())


def test_no_positives_is_a_diagnostic():
    with pytest.raises(RequestError, match="none of 70,000 uniform scenes"):
        boosted(narrow(-1.0), 100, seeded(), draws=70_000)


def test_positives_on_a_knifes_edge_are_repeated():
    # abs(x - c) <= 0 for the c of one drawn scene: no move keeps it.
    spec = narrow(1.0)
    x = float(uniform(spec, 50, seeded()).rows[0, 0])
    nodes = (
        Const(x),
        Coord(0, 0),
        Apply("sub", (0, 1)),
        Apply("abs", (2,)),
        Const(0.0),
        Apply("sub", (4, 3)),
        Atom(5, "edge", LENGTH, ()),
    )
    edge = CheckedSpec("edge.spec", "edge", Workspace(), Core(nodes, {"task": 6}, ("mug",)))
    assert boosted(edge, 50, seeded(), positives=0.5).positives == 0.5


def test_unknown_data_set():
    with pytest.raises(RequestError, match="did you mean `uniform`"):
        dataset_maker("unifrom")


@pytest.mark.long
def test_balanced_scenes_are_exact_and_flat(exp1):
    """Jointly over the cells that are in reach: no part of the range has much more or less than its share."""
    data = balanced(exp1, 8000, seeded(1))
    assert len(data) == 8000 and torch.unique(data.rows, dim=1).shape[1] == 8000
    np.testing.assert_allclose(data.phi.numpy(), numpy_phi(data.rows), atol=1e-6)
    joint, plain = (
        np.histogram2d(*phi.numpy(), bins=4, range=((-1.0, 1.0), (-0.25, 1.15)))[0]
        for phi in (data.phi, uniform(exp1, 8000, seeded(1)).phi)
    )
    # Uniform scenes leave one of the 13 parts that scenes reach empty, and two to a dozen or two. The rarest two hold 5
    # to 15 balanced scenes, whatever the seed.
    assert (joint >= 4).sum() == 13 and (joint > 300).sum() == 11
    assert (plain >= 10).sum() == 11 and (plain > 300).sum() == 8
    assert joint.max() < 2 * 8000 / 13


def test_balanced_data_has_the_part_that_is_nearly_solved():
    spec = narrow(0.02)  # phi from -0.98 to 0.02
    data = balanced(spec, 4000, seeded())
    near = float((data.phi.abs() <= 0.02).float().mean())
    assert near == pytest.approx(0.5 + 0.5 * 0.04, abs=0.02)
    far = data.phi[data.phi < -0.02]
    counts = torch.histc(far, 8)
    assert float(counts.max() / counts.min()) < 1.5


@pytest.mark.long
def test_balanced_data_keeps_what_is_required():
    spec = check_text("object mug, plate\nrequire noOverlap()\ntask: closeTo(mug, plate, 0.2)", "apart.spec")
    data = balanced(spec, 500, seeded())
    core = gated(spec.core)
    assert (Robustness(core).rows(data.rows.double())[-1] >= -1e-6).all()


def test_a_label_that_cannot_vary_is_told():
    spec = check_text("task: 0 * x(mug) <= 1 & x(mug) <= 2 + 0 * x(mug)", "still.spec")
    with pytest.raises(RequestError, match="phi of `task` is 1 in every scene"):
        balanced(spec, 100, seeded())


@pytest.mark.parametrize("name", ["uniform", "boosted"])
def test_held_objects_and_requirements(name):
    text = "object mug, plate at (0.5, 0.4, 1)\nrequire noOverlap()\ntask: leftOf(mug, plate)"
    spec = check_text(text, "held.spec")
    data = dataset_maker(name)(spec, 3000, seeded())
    assert torch.allclose(data.rows[3:], torch.tensor([0.5, 0.4, 1.0])[:, None].expand(3, 3000))
    assert (Robustness(gated(spec.core)).rows(data.rows)[-1] >= 0.0).all()


def test_a_requirement_that_plain_draws_do_not_meet():
    spec = check_text("object mug, plate\nrequire closeTo(mug, plate, 0.0001)\ntask: leftOf(mug, plate)", "rare.spec")
    with pytest.raises(RequestError, match="too rare for plain draws"):
        uniform(spec, 100, seeded())
