"""Model files: what is written comes back, and nothing but a diagnostic comes of a bad file. A model that is told some
of its labels: which are left out in training, and what the networks then see.
"""

import errno
import json
import math
import os
import random
import resource

import numpy as np
import pytest
import safetensors.torch
import torch
from hypothesis import given
from hypothesis import strategies as st

from scenegen.errors import DataError, OutputError
from scenegen.geometry.workspace import Workspace
from scenegen.lang.checker import check_text
from scenegen.learn.model import Model
from scenegen.learn.models.card import MODEL_FORMAT
from scenegen.learn.models.checkpoint import MODEL_KEY, TrainedModel, load_model, pack, save_model
from scenegen.learn.models.codec import EVERY, NONE, Codec, Examples, float_bounds
from scenegen.learn.models.conditioned import visible_labels as given_labels
from scenegen.pose import TWO_PI

from .conftest import card_for


def rewritten(path, model, changes):
    """A well-formed file (checksum and all) whose card differs from the good one."""
    card = json.loads(envelope(path)["card"]) | changes
    path.write_bytes(pack(MODEL_FORMAT, json.dumps(card), model.sampler_state()))


def envelope(path):
    with safetensors.safe_open(path, "pt") as file:
        return json.loads(file.metadata()[MODEL_KEY])


def same(path, model):
    loaded = load_model(path).model
    state = model.sampler_state()
    return all(torch.equal(state[key], tensor) for key, tensor in loaded.state_dict().items())


@pytest.mark.parametrize("name", ["gan", "aae"])
def test_what_is_written_comes_back(name, tmp_path, exp1, make_model, make_card):
    model = make_model(name, width=64)
    card = make_card(name, model, exp1)
    path = tmp_path / "m.safetensors"
    save_model(path, model, card)
    first = path.read_bytes()
    save_model(path, model, card)
    assert path.read_bytes() == first
    assert path.stat().st_size < 600_000
    loaded = load_model(path, exp1)
    assert loaded.card == card
    assert (loaded.name, loaded.objects, loaded.labels) == (name, ("mug", "plate"), ("task", "safe"))
    assert loaded.label_ranges == {"task": (-1.0, 1.0), "safe": (-1.0, 1.0)}
    phi = torch.zeros(2)
    one, two = (m.sample(7, phi, torch.Generator().manual_seed(1)) for m in (model, loaded.model))
    assert torch.equal(one, two)


def test_proposals_are_scenes(model_file):
    trained = load_model(model_file[0])
    rows = trained.propose(torch.zeros(2, 11), torch.Generator().manual_seed(0))
    assert rows.shape == (6, 11) and rows.is_contiguous()
    assert trained.card.area.contains(rows.double().numpy()).all()
    again = trained.propose(torch.zeros(2, 11), torch.Generator().manual_seed(0))
    assert torch.equal(rows, again)
    far = trained.propose(torch.full((2, 11), 50.0), torch.Generator().manual_seed(0))
    assert not torch.equal(rows, far)  # labels outside the training range reach the network as they are
    with pytest.raises(DataError, match=r"give it \(2, n\)|give \(2, n\)"):
        trained.propose(torch.zeros(3, 11), torch.Generator())


def test_another_spec_is_refused_and_both_are_named(model_file, make_exp1):
    load_model(model_file[0], make_exp1(name="elsewhere.spec"))  # the same text under another name is the same spec
    with pytest.raises(DataError, match=r"`exp1.spec`, not `other.spec`"):
        load_model(model_file[0], make_exp1(closeness=0.3, name="other.spec"))


def test_missing_folder_empty_and_garbage(tmp_path):
    (tmp_path / "empty").write_bytes(b"")
    (tmp_path / "garbage").write_bytes(random.Random(0).randbytes(5000))
    (tmp_path / "text").write_text('{"format": "scenegen/model"}')
    (tmp_path / "pickle").write_bytes(b"\x80\x04\x95\x0b\x00\x00\x00\x00\x00\x00\x00\x8c\x02os\x94.")
    (tmp_path / "deep").write_bytes((200_000).to_bytes(8, "little") + b"{" * 200_000)
    (tmp_path / "claims").write_bytes((2**63).to_bytes(8, "little") + b"{}")
    for name in ("missing", ".", "empty", "garbage", "text", "pickle", "deep", "claims"):
        with pytest.raises(DataError):
            load_model(tmp_path / name)


def test_a_foreign_safetensors_file(tmp_path):
    path = tmp_path / "llm.safetensors"
    for metadata in (
        None,
        {"format": "pt"},
        {MODEL_KEY: "not json"},
        {MODEL_KEY: "[]"},
        {MODEL_KEY: '{"format": "else", "version": 1}'},
    ):
        path.write_bytes(safetensors.torch.save({"w": torch.zeros(3)}, metadata))
        with pytest.raises(DataError, match=r"llm\.safetensors"):
            load_model(path)


def test_another_format_version_says_so(model_file):
    path, model = model_file
    later = json.dumps(envelope(path) | {"version": 2, "news": True})
    path.write_bytes(safetensors.torch.save(model.sampler_state(), {MODEL_KEY: later}))
    with pytest.raises(DataError, match="version 2"):
        load_model(path)


def test_truncated_at_any_length(model_file):
    path, _ = model_file
    whole = path.read_bytes()
    for length in [*range(0, 60, 3), *range(60, len(whole), len(whole) // 150), len(whole) - 1]:
        path.write_bytes(whole[:length])
        with pytest.raises(DataError):
            load_model(path)
    path.write_bytes(whole + b"\0")
    with pytest.raises(DataError):
        load_model(path)


def test_flipped_bytes_never_pass_unnoticed(model_file):
    path, model = model_file
    whole, card = path.read_bytes(), load_model(path).card
    header = int.from_bytes(whole[:8], "little") + 8
    rng = random.Random(0)
    for trial in range(400):
        data = bytearray(whole)
        for _ in range(rng.choice([1, 1, 4])):
            data[rng.randrange(header if trial % 4 else len(whole))] ^= rng.randrange(1, 256)
        path.write_bytes(data)
        try:
            # A space of the header's padding may turn into another white space: then nothing is lost.
            assert same(path, model) and load_model(path).card == card
        except DataError as error:
            assert "Traceback" not in str(error)


@pytest.mark.parametrize("kind", ["missing", "shape", "dtype", "nan", "extra"])
def test_weights_that_do_not_fit(kind, model_file):
    path, model = model_file
    state = model.sampler_state()
    name = "decoder.body.layers.0.weight"
    if kind == "missing":
        del state[name]
    elif kind == "extra":
        state["stranger"] = torch.zeros(2)
    else:
        bad = {"shape": state[name][:-1], "dtype": state[name].double(), "nan": torch.full_like(state[name], torch.nan)}
        state[name] = bad[kind]
    path.write_bytes(pack(MODEL_FORMAT, envelope(path)["card"], state))
    with pytest.raises(DataError, match="stranger" if kind == "extra" else name):
        load_model(path)


def test_absurd_sizes_cost_nothing(model_file):
    path, model = model_file
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for changes in (
        {"hyper": {"width": 10**15}},
        {"hyper": {"width": 8192}},
        {"hyper": {"width": -1}},
        {"hyper": {"width": "x"}},
        {"hyper": {"layers": 3}},
        {"objects": [f"o{index}" for index in range(10_000)]},
        {"objects": [f"o{index}" for index in range(10_001)]},
        {"objects": []},
        {"labels": []},
        {"labels": [{"name": "a", "lowest": 1.0, "highest": 0.0}]},
        {"labels": [{"name": "a", "lowest": 0.0, "highest": 1e999}]},
        {"workspace": {"x": [1.0, 1.0], "y": [0.0, 1.0]}},
        {"model": "os:system"},
        {"model": "transformer"},
        {"recipe": "paper"},
        {"epochs_done": -1},
        {"surprise": 1},
        {"spec": {"name": "a", "source": "b", "sha256": "0" * 64}},
    ):
        good = path.read_bytes()
        rewritten(path, model, changes)
        with pytest.raises(DataError):
            load_model(path)
        path.write_bytes(good)
    # The process's high-water mark in KiB; a layer of 10^15 numbers would need petabytes.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000
    assert same(path, model)


def test_a_full_disk_leaves_the_old_model(model_file, exp1, make_model, make_card, monkeypatch):
    path, old = model_file
    new = make_model("aae", seed=9, width=16, depth=2)
    real = os.fdopen

    def full(*args, **kwargs):
        file = real(*args, **kwargs)

        class Full:
            def __enter__(self):
                return self

            def __exit__(self, *error):
                file.close()

            def write(self, data):
                file.write(data[: len(data) // 2])
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        return Full()

    monkeypatch.setattr(os, "fdopen", full)
    with pytest.raises(OutputError, match="no space left"):
        save_model(path, new, make_card("aae", new, exp1))
    assert same(path, old)
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize(
    ("what", "change"),
    [
        ("objects", {"objects": ["a", "b"]}),
        ("labels", {"labels": [{"name": name, "lowest": -1.0, "highest": 1.0} for name in ("task", "zzz")]}),
        ("workspace", {"workspace": {"x": [0.0, 5.0], "y": [0.0, 5.0]}}),
    ],
)
def test_a_card_that_contradicts_its_spec_is_refused(model_file, what, change):
    path, model = model_file
    rewritten(path, model, change)
    with pytest.raises(DataError, match=f"its {what} are not those of the spec in it"):
        Model(load_model(path))


UNIT = st.lists(
    st.sampled_from([0.0, 1.0, 0.5, 1e-8, 1.0 - 6e-8]) | st.floats(0.0, 1.0, width=32), min_size=6, max_size=6
)
EDGE = st.floats(-100.0, 100.0).filter(lambda value: abs(value) > 1e-6)
SIDE = st.tuples(EDGE, st.floats(1e-2, 100.0)).map(lambda pair: (pair[0], pair[0] + pair[1]))


@given(x=UNIT, side_x=SIDE, side_y=SIDE, dtype=st.sampled_from([torch.float32, torch.float64]))
def test_decoded_poses_lie_in_the_workspace_and_the_circle(x, side_x, side_y, dtype):
    space = Workspace(x=side_x, y=side_y)
    rows = Codec(space, 2).decode(torch.tensor([x], dtype=dtype))
    assert rows.shape == (6, 1) and rows.dtype == dtype
    assert space.contains(rows.double().numpy()).all()


def test_round_trip_and_meaning():
    space = Workspace(x=(-1.0, 3.0), y=(2.0, 2.5))
    codec = Codec(space, 2)
    rows = torch.tensor([[0.0], [2.25], [np.pi], [3.0], [2.0], [1.5 * np.pi]], dtype=torch.float64)
    assert codec.encode(rows)[0].tolist() == pytest.approx([0.25, 0.5, 0.5, 1.0, 0.0, 0.75])
    x = torch.rand(1000, 6, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(codec.encode(codec.decode(x)), x, atol=1e-6, rtol=0.0)


def test_angles_outside_the_circle_are_brought_into_it():
    codec = Codec(Workspace(), 1)
    rows = torch.zeros(3, 4)
    rows[2] = torch.tensor([-0.5 * np.pi, TWO_PI, -1e-9, 5.0 * np.pi])
    theta = codec.encode(rows)[:, 2]
    assert bool(((theta >= 0.0) & (theta < 1.0)).all())
    assert theta.tolist() == pytest.approx([0.75, 0.0, 0.0, 0.5], abs=1e-6)


@pytest.mark.parametrize("scenes", [1, 2])
def test_the_argument_is_left_alone(scenes):
    x = torch.rand(scenes, 3, generator=torch.Generator().manual_seed(0))
    before = x.clone()
    codec = Codec(Workspace(x=(5.0, 6.0)), 1)
    rows = codec.decode(x)
    assert torch.equal(x, before)
    kept = rows.clone()
    codec.encode(rows)
    assert torch.equal(rows, kept)


def test_rounding_goes_inwards():
    low, high = float_bounds(0.7, 0.1 + 0.7, torch.float32)
    assert 0.7 <= low < 0.7 + 1e-6 and 0.8 - 1e-6 < high <= 0.1 + 0.7


def batch(balanced, labels=4):
    count = len(balanced)
    zeros = torch.zeros(count, labels)
    return Examples(torch.zeros(count, 6), zeros, torch.zeros(count, dtype=torch.int64), torch.tensor(balanced))


def test_labels_by_which_scenes_were_balanced_are_never_left_out():
    told = given_labels(batch([2] * 500 + [EVERY] * 500 + [NONE] * 500), torch.Generator().manual_seed(0))
    assert bool(told[:500, 2].all()) and bool(told[500:1000].all())
    counts = told.sum(1)
    assert {1, 2, 4} <= set(counts[:500].tolist()) and int(counts.min()) == 1
    assert all(0.2 < float(told[1000:, label].float().mean()) < 0.7 for label in range(4))


def test_free_labels_do_not_reach_the_network(make_model):
    model = make_model("flow", 2, 3, width=16, depth=2)
    phi = torch.tensor([[0.1, math.nan, -0.2], [0.1, 0.3, -0.2]])
    features = model.view.features(phi)
    assert features.shape == (2, 9) and bool(torch.isfinite(features).all())
    assert features[0, [1, 4, 7]].tolist() == [0.0] * 3 and features[1, 7] == 1.0
    torch.testing.assert_close(features[0, [0, 2, 3, 5]], features[1, [0, 2, 3, 5]])


@pytest.mark.parametrize("name", ["flow", "gan", "aae"])
def test_every_default_model_is_asked_for_some(name, make):
    made = make(name, 2, 3)
    spec = check_text("object a, b\none: leftOf(a, b)\ntwo: aboveOf(a, b)\nthree: closeTo(a, b)", "three.spec")
    trained = TrainedModel(made.model, card_for(name, made.model, spec), spec)
    phi = trained.with_free_labels(torch.zeros(3, 5), ["two"])
    assert bool(torch.isnan(phi[[0, 2]]).all()) and bool((phi[1] == 0.0).all())
    assert trained.propose(phi, torch.Generator().manual_seed(0)).shape == (6, 5)
    assert torch.equal(trained.with_free_labels(torch.zeros(3, 5), []), torch.zeros(3, 5))
