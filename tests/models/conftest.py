import pytest
import torch

from scenegen.models.card import LabelData, LossData, ModelCard, spec_data
from scenegen.models.checkpoint import save_model
from scenegen.models.table import model_class, parse_hyper
from scenegen.scene.data import WorkspaceData


def new_model(name, objects=2, labels=2, seed=0, **hyper):
    """A model with fresh weights whose label range is about [-1, 1]."""
    generator = torch.Generator().manual_seed(seed)
    model = model_class(name)(objects, labels, parse_hyper(name, hyper))
    model.initialise(generator, torch.rand(50, labels, generator=generator) * 2.0 - 1.0)
    return model


def card_for(name, model, spec):
    space = spec.workspace
    return ModelCard(
        scenegen="0.1.0",
        model=name,
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
def make_card():
    return card_for


@pytest.fixture
def model_file(tmp_path, exp1):
    """A model file (AAE with a small code) and the model it was written from."""
    model = new_model("aae", latent=4)
    path = tmp_path / "exp1.safetensors"
    save_model(path, model, card_for("aae", model, exp1))
    return path, model
