"""Gradients through the atom that decides: those of the whole formula."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings

from scenegen.geometry import NUMPY
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom, gated
from scenegen.lang.formula.interpret import evaluate
from scenegen.learn.robustness import Robustness
from scenegen.learn.robustness.deciding import Slopes

from ..laws import examples
from .formulas import scenes, seeds, specs

TABLE = """object plate, mug, fork, knife, spoon, a = box(0.1, 0.1, 0.05), b = box(0.1, 0.1, 0.05)
region mat = rect(0.3, 0.1, 0.7, 0.4)
region tray = polygon([(0.6, 0.1), (0.9, 0.1), (0.9, 0.5), (0.7, 0.5)])
require noOverlap()
require insideWorkspace()
task: (leftOf(mug, plate) | on(mug, mat)) & inside(a, tray) & theta(fork) >= 1
safe: exists p in [mug, plate, a]: closeTo(p, b, 0.2) & clearOf(p, fork, 3 cm)
"""


def uniform(objects, count, seed=0):
    return torch.rand(3 * objects, count, generator=torch.Generator().manual_seed(seed)) * torch.tensor(
        [1.0, 1.0, 6.2]
    ).repeat(objects).view(-1, 1)


def whole(core, rows):
    """phi and its gradients, of the formula as one, each (L, ...)."""
    rows = rows.clone().requires_grad_()
    values = Robustness(core).rows(rows)
    slopes = [torch.autograd.grad(value.sum(), rows, retain_graph=True)[0] for value in values]
    return values.detach(), torch.stack(slopes)


def everywhere(slopes, rows, atoms):
    where = torch.ones(rows.shape[1], dtype=torch.bool)
    return torch.stack([slopes.gradient(rows, each, where) for each in atoms])


def close(found, wanted):
    """Up to the last bits of sin, cos and atan2, which depend on where in a batch a scene stands."""
    slack = 1e-5 if wanted.dtype == torch.float32 else 1e-13
    torch.testing.assert_close(found, wanted, rtol=slack, atol=slack)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_same_as_of_the_whole_formula(dtype):
    core = gated(check_text(TABLE).core)
    rows, slopes = uniform(7, 4096).to(dtype), Slopes(core)
    values, atoms = slopes(rows)
    wanted, gradients = whole(core, rows)
    assert values.dtype == dtype and torch.equal(values, wanted)
    close(everywhere(slopes, rows, atoms), gradients)
    assert len(atoms[-1].unique()) > 20  # many pairs decide, and footprints of four kinds


def test_the_atom_named_is_one_that_decides():
    core = gated(check_text(TABLE).core)
    rows = uniform(7, 512, 1).double()
    values, atoms = Slopes(core)(rows)
    margins = np.stack([np.broadcast_to(value, 512) for value in evaluate(core, list(rows.numpy()), NUMPY)])
    assert all(isinstance(core.nodes[atom], Atom) for atom in atoms.unique().tolist())
    for value, atom in zip(values, atoms, strict=True):
        np.testing.assert_allclose(margins[atom, np.arange(512)], value, rtol=0.0, atol=1e-14)


def test_only_where_it_is_wanted():
    core = gated(check_text(TABLE).core)
    rows, slopes = uniform(7, 300, 2), Slopes(core)
    atoms = slopes(rows)[1][-1]
    where = torch.arange(300) % 3 == 0
    some = slopes.gradient(rows, atoms, where)
    assert bool((some[:, ~where] == 0.0).all())
    close(some[:, where], slopes.gradient(rows, atoms, ~torch.zeros_like(where))[:, where])
    assert bool((slopes.gradient(rows, atoms, torch.zeros_like(where)) == 0.0).all())


def test_footprints_of_any_size_share_a_form():
    text = "object " + ", ".join(
        f"a{k} = box(0.{k + 10}, 0.05, 0.1), b{k} = cylinder(0.0{k + 3}, 0.1)" for k in range(5)
    )
    core = check_text(text + "\ntask: noOverlap()").core
    rows, slopes = uniform(10, 4096, 3), Slopes(core)
    _, atoms = slopes(rows)
    gradients = everywhere(slopes, rows, atoms)
    assert len(atoms.unique()) > 30 and len(slopes._forms) <= 4  # boxes and circles, in each order
    close(gradients, whole(core, rows)[1])


def test_all_in_one_place_and_what_never_changes():
    """Where most pairs may decide all are computed; a constant has no slope."""
    core = check_text("object a, b, c, d\ntask: noOverlap()\nsafe: 1 <= 2 & x(a) <= 9").core
    rows, slopes = 0.001 * uniform(4, 64, 4), Slopes(core)
    values, atoms = slopes(rows)
    wanted, gradients = whole(core, rows)
    found = everywhere(slopes, rows, atoms)
    assert torch.equal(values, wanted)
    close(found, gradients)
    assert bool((found[1] == 0.0).all())


@pytest.mark.long
@settings(max_examples=examples(60), deadline=None, derandomize=True)
@given(specs(labels=("task", "safe")), seeds)
def test_of_any_formula(spec, seed):
    """Uniform scenes have no ties, and there the gradient is that of the only atom that decides."""
    core = spec.core
    rows = torch.from_numpy(scenes(len(spec.objects), 8, seed))[:, :4].contiguous()
    slopes = Slopes(core)
    values, atoms = slopes(rows)
    wanted, gradients = whole(core, rows)
    assert torch.equal(values, wanted)
    margins = evaluate(core, list(rows.numpy()), NUMPY)
    every = [margins[index] for index, node in enumerate(core.nodes) if isinstance(node, Atom)]
    ties = sum((np.broadcast_to(margin, 4) == value.numpy()).astype(int) for margin in every for value in values[:1])
    alone = torch.from_numpy(ties == 1)
    close(everywhere(slopes, rows, atoms)[0][:, alone], gradients[0][:, alone])
