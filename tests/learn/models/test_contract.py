"""What every entry of MODELS keeps to. A new model is tested by being in the table. Branches, layouts and the
spec_loss, against the scalar oracle.
"""

import numpy as np
import pytest
import torch

from scenegen.errors import DataError, RequestError
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom
from scenegen.lang.formula.interpret import deciding_atom, evaluate, phi
from scenegen.learn.models.base import SceneModel, SpecLoss
from scenegen.learn.models.card import Layout, layout_of
from scenegen.learn.models.codec import MAX_BRANCHES, OTHER, Codec, Examples, survey
from scenegen.learn.models.conditioned import PASSES, Selector
from scenegen.learn.models.registry import MODELS, model_class, parse_hyper
from scenegen.learn.refine import draw
from scenegen.learn.robustness.deciding import deciding_atoms
from scenegen.resources import shipped_specs

from ...laws import FULL

SIZES = [(1, 1), (2, 2), (7, 1)]


def seeded(seed):
    return torch.Generator().manual_seed(seed)


@pytest.fixture(params=list(MODELS))
def make(request, make):
    return lambda *words: make(request.param, *words)


@pytest.mark.long
@pytest.mark.parametrize(("objects", "labels"), SIZES)
def test_samples_have_their_shape_and_lie_in_the_unit_box(objects, labels, make):
    model = make(objects, labels).model
    phi = torch.linspace(-5.0, 5.0, 9 * labels).reshape(9, labels)
    x = model.sample(9, phi, seeded(1))
    assert x.shape == (9, 3 * objects) and x.dtype == torch.float32 and not x.requires_grad
    assert bool(((x >= 0.0) & (x <= 1.0)).all())


@pytest.mark.long
def test_one_vector_of_labels_serves_all_scenes(make):
    model = make().model
    phi = torch.tensor([0.1, -0.2])
    assert torch.equal(model.sample(6, phi, seeded(1)), model.sample(6, phi.expand(6, 2), seeded(1)))


def test_labels_are_heard(make):
    model = make().model
    low, high = (model.sample(6, torch.full((2,), value), seeded(1)) for value in (-1.0, 1.0))
    assert not torch.equal(low, high)


@pytest.mark.long
def test_the_generator_alone_decides(make):
    model = make().model
    phi = torch.zeros(2)
    assert torch.equal(model.sample(8, phi, seeded(1)), model.sample(8, phi, seeded(1)))
    assert not torch.equal(model.sample(8, phi, seeded(1)), model.sample(8, phi, seeded(2)))
    torch.manual_seed(0)
    before = torch.random.get_rng_state()
    made = make()
    other = made.started()
    other.sample(8, phi, seeded(1))
    for batch in made.batches(2, 4):
        other.update(batch, seeded(3))
    assert torch.equal(torch.random.get_rng_state(), before)


@pytest.mark.long
@pytest.mark.parametrize(("objects", "labels"), SIZES)
def test_training_changes_the_model_and_keeps_it_finite(objects, labels, make):
    made = make(objects, labels)
    before = made.model.sampler_state()
    model = made.started()
    generator = seeded(3)
    names = None
    for rows in (16, 1, 16):  # the last batch of an epoch may be smaller, down to one scene
        for batch in made.batches(3, rows):
            losses = model.update(batch, generator)
            assert names in (None, list(losses)) and losses
            names = list(losses)
            assert all(value.ndim == 0 and bool(torch.isfinite(value)) for value in losses.values())
    after = model.sampler_state()
    weights = [key for key in after if key.endswith("weight")]
    assert weights and all(not torch.equal(before[key], after[key]) for key in weights)
    assert all(bool(torch.isfinite(tensor).all()) for tensor in model.training_state().values())


@pytest.mark.long
def test_every_weight_gets_a_gradient(make):
    made = make()
    before = {key: tensor.clone() for key, tensor in made.model.state_dict().items()}
    model = made.started(1e-2)
    generator = seeded(3)
    for batch in made.batches(5, 32):
        model.update(batch, generator)
    still = {key for key, tensor in model.state_dict().items() if torch.equal(tensor, before[key])}
    assert still <= {key for key, _ in model.named_buffers()}


def test_training_is_reproducible_and_goes_on_from_a_state(make):
    made = make()
    whole, first = made.started(), make().started()
    data = list(made.batches(6, 8))
    generator, half = seeded(3), seeded(3)
    for batch in data:
        whole.update(batch, generator)
    for batch in data[:3]:
        first.update(batch, half)
    second = made.blank()
    second.restore(first.training_state(), 1e-3, made.spec_loss, torch.device("cpu"))
    for batch in data[3:]:
        second.update(batch, half)
    expected, got = whole.training_state(), second.training_state()
    assert expected.keys() == got.keys()
    assert all(torch.equal(expected[key], got[key]) for key in expected)


def test_sampler_state_suffices_to_sample(make):
    made = make()
    model, copy = made.model, made.blank()
    copy.drop_training_parts()
    copy.load_weights(model.sampler_state())
    phi = torch.zeros(2)
    assert torch.equal(copy.sample(8, phi, seeded(1)), model.sample(8, phi, seeded(1)))


@pytest.mark.long
def test_a_state_that_does_not_fit_is_refused(make):
    made = make()
    model = made.started()
    for batch in made.batches(1, 4):
        model.update(batch, seeded(3))
    good = model.training_state()
    for key in list(good)[:: 1 if FULL else 5]:
        for bad in (
            {other: tensor for other, tensor in good.items() if other != key} if key.startswith("model.") else None,
            {**good, key: torch.zeros(3, 3, 3)},
            {**good, key: torch.full_like(good[key], torch.nan)},
        ):
            if bad is not None:
                with pytest.raises(DataError):
                    made.blank().restore(bad, 1e-3, made.spec_loss, torch.device("cpu"))


def test_the_table(make):
    kind = type(make().model)
    assert issubclass(kind, SceneModel) and kind.__doc__


def test_unknown_names_and_settings_are_diagnostics():
    with pytest.raises(RequestError, match="did you mean `gan`"):
        model_class("gann")
    with pytest.raises(RequestError, match="`width`"):
        parse_hyper("gan", {"widht": 3})
    with pytest.raises(RequestError, match="width"):
        parse_hyper("aae", {"width": 0})


SPECS = ("mug_left_of_plate", "table_setting", "sort_7", "chess_corner", "recycling")


def spec_and_rows(name, count=300):
    spec = check_text(shipped_specs()[name].read_text(), name)
    return spec, draw(*spec.box(), count, torch.Generator().manual_seed(0))


@pytest.mark.parametrize("name", SPECS)
def test_the_deciding_atom_is_the_oracles(name):
    spec, rows = spec_and_rows(name)
    found = deciding_atoms(spec.core, rows).numpy()
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
    assert branch.shape == (2000,) and table.shape[1] == len(spec.labels) and len(table) <= MAX_BRANCHES
    if OTHER not in table:
        assert torch.equal(table[branch].T, deciding_atoms(spec.core, rows))
        assert (counts.diff() <= 0).all()
    x = Codec(spec.workspace, len(spec.objects)).encode(rows.float())
    got, atoms = SpecLoss(spec.core, table, Codec(spec.workspace, len(spec.objects)))(x, branch)
    expected = np.array([list(phi(spec.core, scene).values()) for scene in rows.T.tolist()])
    np.testing.assert_allclose(got.numpy(), expected, atol=2e-5)
    np.testing.assert_allclose(atoms.numpy(), expected, atol=2e-5)


def test_rare_branches_share_one():
    names = [f"o{index}" for index in range(MAX_BRANCHES + 20)]
    spec = check_text(f"object {', '.join(names)}\ntask: " + " & ".join(f"x({name}) <= 0.5" for name in names), "many")
    rows = draw(*spec.box(), 5000, torch.Generator().manual_seed(0))
    branch, table = survey(spec, rows)
    assert len(table) == MAX_BRANCHES and (table[-1] == OTHER).all() and (table[:-1] != OTHER).all()
    rest = branch == MAX_BRANCHES - 1
    assert 0 < int(rest.sum()) < 5000 and torch.equal(table[branch][~rest].T, deciding_atoms(spec.core, rows)[:, ~rest])
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
