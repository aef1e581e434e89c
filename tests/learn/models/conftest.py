import pytest
import torch

from scenegen.lang.checker import check_text
from scenegen.learn.models.base import SpecLoss
from scenegen.learn.models.card import LabelData, LossData, ModelCard, layout_of, spec_data
from scenegen.learn.models.checkpoint import save_model
from scenegen.learn.models.codec import Codec, Examples, survey
from scenegen.learn.models.registry import model_class, parse_hyper
from scenegen.learn.training.dataset import uniform
from scenegen.scenes.data import WorkspaceData


def plain_spec(objects, labels):
    """A spec whose phi depends on every x, on one heading and on no y."""
    names = [f"o{index}" for index in range(objects)]
    below = " & ".join(f"x({name}) <= 0.{index + 5}" for index, name in enumerate(names))
    lines = [f"label{k}: {below} & angle(o0, NORTH, 0.{k + 1})" for k in range(labels)]
    return check_text("\n".join([f"object {', '.join(names)}", *lines]), "plain.spec")


def examples_of(spec, count, seed):
    """Uniform scenes, their labels and branches, and what judges a model's own scenes."""
    data = uniform(spec, count, torch.Generator().manual_seed(seed))
    codec = Codec(spec.workspace, len(spec.objects))
    branch, table = survey(spec, data.rows)
    return Examples(codec.encode(data.rows), data.phi.T.contiguous(), branch), SpecLoss(spec.core, table, codec), table


def bound(model, spec):
    model.bind(spec)
    return model


class Made:
    """A model with fresh weights, and what it takes to train it."""

    def __init__(self, name, objects=2, labels=2, seed=0, **hyper):
        self.spec = plain_spec(objects, labels)
        self.examples, self.spec_loss, table = examples_of(self.spec, 500, seed)
        kind, layout = model_class(name), layout_of(self.spec.core, len(table))
        self.blank = lambda: bound(kind(layout, parse_hyper(name, hyper)), self.spec)
        self.model = self.blank()
        self.model.initialise(torch.Generator().manual_seed(seed))
        self.model.fit(self.examples)

    def started(self, lr=1e-3):
        self.model.start(lr, self.spec_loss)
        return self.model

    def batches(self, count, rows, seed=5):
        generator = torch.Generator().manual_seed(seed)
        for _ in range(count):
            yield self.examples.take(torch.randint(len(self.examples), (rows,), generator=generator))


def new_model(name, *words, **hyper):
    return Made(name, *words, **hyper).model


def card_for(name, model, spec):
    space = spec.workspace
    return ModelCard(
        scenegen="0.1.0",
        model=name,
        recipe="default",
        layout=model.layout,
        hyper=model.hyper.model_dump(),
        spec=spec_data(spec),
        workspace=WorkspaceData(x=space.x, y=space.y),
        objects=list(spec.objects),
        labels=[LabelData(name=label, lowest=-1.0, highest=1.0) for label in spec.labels],
        training={"epochs": 1, "lr": 0.001, "hyper": {}},
        epochs_done=1,
        losses=LossData(epochs=[1], means={"generator": [0.7]}),
    )


@pytest.fixture
def make_model():
    return new_model


@pytest.fixture
def make():
    return Made


@pytest.fixture
def make_card():
    return card_for


@pytest.fixture
def model_file(tmp_path, exp1):
    """A model file (a small AAE) and the model it was written from."""
    model = new_model("aae", width=16, depth=2)
    path = tmp_path / "exp1.safetensors"
    save_model(path, model, card_for("aae", model, exp1))
    return path, model
