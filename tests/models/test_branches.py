"""Branches, layouts and the spec_loss, against the scalar oracle."""

import numpy as np
import pytest
import torch

from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom
from scenegen.lang.formula.interpret import deciding_atom, evaluate, phi
from scenegen.learn.models.base import SpecLoss
from scenegen.learn.models.card import Layout, layout_of
from scenegen.learn.models.codec import MOST, OTHER, Codec, Examples, survey
from scenegen.learn.models.conditioned import PASSES, Selector
from scenegen.learn.refine import draw
from scenegen.learn.robustness.deciding import deciding
from scenegen.resources import shipped_specs

SPECS = ("mug_left_of_plate", "table_setting", "sort_7", "chess_corner", "recycling")


def spec_and_rows(name, count=300):
    spec = check_text(shipped_specs()[name].read_text(), name)
    return spec, draw(*spec.box(), count, torch.Generator().manual_seed(0))


@pytest.mark.parametrize("name", SPECS)
def test_the_deciding_atom_is_the_oracles(name):
    spec, rows = spec_and_rows(name)
    found = deciding(spec.core, rows).numpy()
    for scene, column in zip(rows.T.tolist(), found.T, strict=True):
        values = evaluate(spec.core, scene)
        for label, node in zip(spec.labels, column, strict=True):
            # torch may be off in the last bit, so a tie in it may be none to the oracle
            wanted = values[deciding_atom(spec.core, label, values)]
            assert isinstance(spec.core.nodes[node], Atom) and values[node] == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("name", SPECS)
def test_a_branch_names_the_atoms_that_decide(name):
    spec, rows = spec_and_rows(name, 2000)
    branch, table = survey(spec, rows)
    counts = torch.bincount(branch, minlength=len(table))
    assert branch.shape == (2000,) and table.shape[1] == len(spec.labels) and len(table) <= MOST
    if OTHER not in table:
        assert torch.equal(table[branch].T, deciding(spec.core, rows))
        assert (counts.diff() <= 0).all()
    x = Codec(spec.workspace, len(spec.objects)).encode(rows.float())
    got, atoms = SpecLoss(spec.core, table, Codec(spec.workspace, len(spec.objects)))(x, branch)
    expected = np.array([list(phi(spec.core, scene).values()) for scene in rows.T.tolist()])
    np.testing.assert_allclose(got.numpy(), expected, atol=2e-5)
    np.testing.assert_allclose(atoms.numpy(), expected, atol=2e-5)


def test_rare_branches_share_one():
    names = [f"o{index}" for index in range(MOST + 20)]
    spec = check_text(f"object {', '.join(names)}\ntask: " + " & ".join(f"x({name}) <= 0.5" for name in names), "many")
    rows = draw(*spec.box(), 5000, torch.Generator().manual_seed(0))
    branch, table = survey(spec, rows)
    assert len(table) == MOST and (table[-1] == OTHER).all() and (table[:-1] != OTHER).all()
    rest = branch == MOST - 1
    assert 0 < int(rest.sum()) < 5000 and torch.equal(table[branch][~rest].T, deciding(spec.core, rows)[:, ~rest])
    codec = Codec(spec.workspace, len(names))
    reached, atoms = SpecLoss(spec.core, table, codec)(codec.encode(rows.float()), branch)
    assert torch.equal(reached, atoms)  # where no atom is known, phi stands for it


def test_gradients_reach_the_branchs_atom_only():
    spec = check_text("object a, b\ntask: x(a) <= 0.5 & x(b) <= 0.5", "two")
    codec = Codec(spec.workspace, 2)
    rows = draw(*spec.box(), 100, torch.Generator().manual_seed(0))
    branch, table = survey(spec, rows)
    x = codec.encode(rows.float()).requires_grad_(True)
    _, atoms = SpecLoss(spec.core, table, codec)(x, 1 - branch)  # the atom that does not decide
    (gradient,) = torch.autograd.grad(atoms.sum(), x)
    moved = gradient[:, [0, 3]] != 0.0
    assert (moved.sum(1) == 1).all()
    decides = (x[:, 3] > x[:, 0]).long()
    assert torch.equal(moved.long().argmax(1), 1 - decides)


def test_what_phi_does_not_depend_on_is_free():
    spec = check_text("object a, b, c\nrequire y(c) >= 0.2\ntask: x(a) <= 0.5 & angle(b, NORTH)", "free")
    assert layout_of(spec.core, 2) == Layout(objects=3, labels=1, positions=(0, 7), angles=(5,), branches=2)
    for bad in ({"positions": (0, 0)}, {"positions": (9,)}, {"angles": (-1,)}, {"branches": 0}):
        with pytest.raises(ValueError, match="validation error"):
            Layout(**{"objects": 3, "labels": 1, **bad})


def test_the_selector_learns_how_often_each_branch_occurs():
    rng = np.random.default_rng(5)
    wanted = torch.from_numpy(rng.uniform(-1.0, 1.0, (20_000, 1)).astype(np.float32))
    share = torch.sigmoid(6.0 * wanted[:, 0])
    branch = (torch.from_numpy(rng.random(20_000)) < share).long()
    examples = Examples(wanted.new_empty(len(wanted), 0), wanted, branch)
    selector = Selector(Layout(objects=1, labels=1, branches=2))
    selector.initialise(torch.Generator().manual_seed(1))
    calls = []
    selector.learn(
        examples, lambda batch: batch.phi.repeat(1, 2), torch.Generator().manual_seed(2), lambda: calls.append(1)
    )
    asked = torch.linspace(-0.9, 0.9, 13)[:, None]
    found = torch.softmax(selector.body(asked.repeat(1, 2)), dim=1)[:, 1].detach()
    assert float((found - torch.sigmoid(6.0 * asked[:, 0])).abs().max()) < 0.05
    assert len(calls) == PASSES
