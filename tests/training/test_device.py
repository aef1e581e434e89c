"""Every model does all of its work on its device: on the meta device, a tensor left on the CPU would not mix."""

import pytest
import torch

from scenegen.lang.checker import check_text
from scenegen.learn.models.registry import RECIPES
from scenegen.learn.training.config import make_config
from scenegen.learn.training.feed import make_feed
from scenegen.learn.training.session import TrainingSession

TEXT = """
object mug, plate, fork
task: leftOf(mug, plate) & angle(mug, NORTH, 0.2) | aboveOf(mug, plate)
safe: !closeTo(mug, plate, 0.25)
"""


@pytest.mark.long
@pytest.mark.parametrize(("recipe", "model"), [(recipe, model) for recipe in RECIPES for model in RECIPES[recipe]])
def test_a_step_and_a_sample(recipe, model):
    spec = check_text(TEXT, "a.spec")
    config = make_config(model, recipe, data="uniform", scenes=100)
    feed = make_feed(spec, config)
    session = TrainingSession(spec, config, feed, None)
    device = torch.device("meta")
    session.model.to(device)
    session.model.start(1e-3, session.spec_loss)
    for optimiser in session.model.optimisers.values():
        optimiser.step = lambda *_: None  # the fused kernels have no meta version; they know all devices that matter
    batch = feed.fitting.to(device).take(slice(0, 32))
    losses = session.model.update(batch, None)
    assert losses and all(value.device == device for value in losses.values())
    for phi in (batch.phi[:10], batch.phi[0]):
        x = session.model.sample(10, phi, None)
        assert x.shape == (10, 9) and x.device == device
    reached = session.spec_loss.phi(x)
    assert reached.shape == (10, 2) and reached.device == device
